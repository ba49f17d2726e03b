"""A growing crack on all ranks against the same run on one."""
import numpy as np
import pytest

from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from pdhpc.simulation import Simulation
from pdhpc.study.verify.case import plate
from pdhpc.study.verify.fracture import GROWING_CRACK


def gathered(comm, simulation):
    """Return {name: array sorted by id} of the whole body, on every rank."""
    particles = simulation.problem.subdomain.particles
    parts = {"id": particles.id[particles.owned], "u": particles.displacement, "v": particles.velocity, "damage": simulation.problem.subdomain.bonds.damage()}
    whole = {name: np.concatenate(comm.allgather(values)) for name, values in parts.items()}
    order = np.argsort(whole["id"])
    return {name: values[order] for name, values in whole.items()}


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("overrides", [[], ["particles.kinematics=linear", "particles.influence=gaussian", "particles.volume_correction=none"]])
def test_the_same_bits_as_on_one_rank(comm, overrides):
    from mpi4py import MPI

    scene = parse_scene(GROWING_CRACK, "crack", ["time.end=14e-6", *overrides])
    together, alone = Simulation(scene, comm), Simulation(scene, MPI.COMM_SELF)
    assert together.problem.dt == alone.problem.dt
    record, reference = together.run(quiet=True), alone.run(quiet=True)
    for name, values in gathered(comm, together).items():
        assert np.array_equal(values, gathered(MPI.COMM_SELF, alone)[name]), name
    assert reference["broken_bonds"] > 100
    for name in ("energies", "broken_bonds", "particles", "bonds", "bond_evaluations", "critical_dt"):
        assert record[name] == reference[name], name
    assert record["ghosts"] > 0 and record["sent_per_step"] == record["ghosts"]
    assert record["tips"] == reference["tips"]


@pytest.mark.mpi(min_size=2)
def test_more_ranks_than_particles(comm):
    scene = parse_scene(plate((2, 1), 2.0), "t")
    record = Simulation(scene, comm).run(quiet=True)
    assert record["particles"] == 2 and record["bonds"] == 1


@pytest.mark.mpi(min_size=2)
def test_three_dimensions_and_two_materials(comm):
    from mpi4py import MPI

    second = '[[material]]\nname = "stiff"\ndensity = 2.0\nyoungs_modulus = 5.0\n[[body]]\nname = "r"\nmaterial = "stiff"\nshape = "box"\nlower = [4.0, -3.0, -3.0]\nupper = [8.0, 3.0, 3.0]\n'
    kick = "[[initial]]\nvelocity_gradient = [[0.02, 0.0, 0.01], [0.0, -0.01, 0.0], [0.0, 0.02, 0.0]]\n"
    scene = parse_scene(plate((8, 6, 6), 2.0, kinematics="finite", material="critical_stretch = 0.02", dimension="3d", extra=second + kick), "t", ["time.end=20.0"])
    together, alone = Simulation(scene, comm), Simulation(scene, MPI.COMM_SELF)
    together.run(quiet=True)
    assert alone.run(quiet=True)["broken_bonds"] > 0
    for name, values in gathered(comm, together).items():
        assert np.array_equal(values, gathered(MPI.COMM_SELF, alone)[name]), name


@pytest.mark.mpi(min_size=2)
def test_an_empty_region_is_an_error_on_every_rank(comm):
    extra = '[[region]]\nname = "r"\nshape = "box"\nlower = [0.1, 0.1]\nupper = [0.2, 0.2]\n[damage]\nno_fail = ["r"]\n'
    with pytest.raises(SceneError, match="selects no particle"):
        Simulation(parse_scene(plate((8, 8), extra=extra), "t"), comm)
