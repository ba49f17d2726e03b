"""Bodies that stand still, on all ranks against one: the same bits by relaxation, to the tolerance of equilibria by Newton; bonds break alike."""
import numpy as np
import pytest

from pdhpc.run import RunError
from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from pdhpc.simulation import Simulation
from pdhpc.study.verify.static import notched, still
from tests.mpi.test_simulation import PATHS, gathered


def both(comm, text, overrides=()):
    """Run a scene on all ranks and on one; return [(record, fields of the whole body sorted by id)]."""
    from mpi4py import MPI

    found = []
    for ranks in (comm, MPI.COMM_SELF):
        simulation = Simulation(parse_scene(text, "strip", list(overrides)), ranks)
        record = simulation.run(quiet=True)
        found.append((record, gathered(ranks, simulation)))
    return found


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("model, kinematics, breaking", [("pmb", "linear", "all"), ("pmb", "finite", "most_strained"), ("lps", "finite", "all")])
def test_relaxation_has_the_same_bits(comm, path, model, kinematics, breaking):
    (record, fields), (alone, expected) = both(comm, notched("relaxation", breaking, model, kinematics, 3, (26, 15)), [f"particles.path={path}"])
    for name, values in fields.items():
        assert np.array_equal(values, expected[name]), name
    for name in ("energies", "broken_bonds", "equilibrium", "bond_evaluations"):
        assert record[name] == alone[name], name
    assert record["broken_bonds"] > 50 and record["ghosts"] > 0


BY_ENERGY = ("critical_stretch = 0.01", 'energy_release_rate = 2.15e-4\nfailure = "energy"')
"""The energy release rate of s0 = 0.01 at E = 1, horizon 3 in plane stress: G = 9 E horizon s0^2/(4 pi)."""
WIDE = '[[body]]\nname = "wide"\nmaterial = "solid"\nshape = "box"\nlower = [13.0, -7.5]\nupper = [16.0, 7.5]\nhorizon = 2.5\n'


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("method", ("relaxation", "newton"))
@pytest.mark.parametrize("model, text, options", [
    ("pmb", ("", ""), ["particles.influence=conical", "particles.surface_correction=energy"]), ("pmb", BY_ENERGY, ["particles.surface_correction=volume"]),
    ("lps", BY_ENERGY, []), ("pmb", ("", ""), ["material.solid.stretch_softening=0.25"]), ("pmb", ("[[body]]", WIDE + "[[body]]"), []),
], ids=["conical", "energy", "lps", "softening", "horizons"])
def test_laws_and_corrections_at_rest(comm, method, model, text, options):
    """Relaxation has the same bits, Newton the same bonds; at the end no intact bond is beyond its limit."""
    from mpi4py import MPI

    scene = parse_scene(notched(method, "all", model, "finite", 3, (26, 15)).replace(*text, 1), "strip", options)
    together, alone = (Simulation(scene, ranks) for ranks in (comm, MPI.COMM_SELF))
    record, reference = (simulation.run(quiet=True) for simulation in (together, alone))
    fields, expected = gathered(comm, together), gathered(MPI.COMM_SELF, alone)
    for name, values in fields.items():
        assert np.array_equal(values, expected[name]) if method == "relaxation" or name == "alive" else True, name
    assert record["broken_bonds"] == reference["broken_bonds"] > 20
    assert comm.allreduce(together.stepper._breaking.evaluate()) == 0


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("model, kinematics", [("pmb", "linear"), ("lps", "finite")])
def test_newton_finds_the_same_equilibria(comm, path, model, kinematics):
    """Displacements agree to 1e-5 of the largest at a residual of 1e-7; the bonds are the same."""
    (record, fields), (alone, expected) = both(comm, notched("newton", "all", model, kinematics, 3, (26, 15)), [f"particles.path={path}"])
    assert np.array_equal(fields["alive"], expected["alive"]) and record["broken_bonds"] == alone["broken_bonds"] > 50
    scale = np.abs(expected["displacement"]).max()
    assert np.abs(fields["displacement"] - expected["displacement"]).max() < 1e-5 * scale
    assert record["energies"]["external_work"] == pytest.approx(alone["energies"]["external_work"], rel=1e-6)


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("method", ("relaxation", "newton"))
def test_a_rank_without_particles_takes_part(comm, method):
    extra = '[[load]]\ntype = "gravity"\nvalue = [1e-3, 0.0]\n'
    text = still((4, 1), method, extra=extra).replace("horizon = 3.0", "horizon = 2.0").replace("point = [1.0, 0.0]", "point = [-1.0, 0.0]").replace("value = [0.0, 0.0]", 'value = [0.0, 0.0]', 1)
    text += '[[region]]\nname = "rest"\nshape = "half_space"\npoint = [-0.9, 0.0]\nnormal = [1.0, 0.0]\n[[load]]\ntype = "displacement"\nregion = "rest"\nvalue = ["free", 0.0]\n'
    from mpi4py import MPI

    with_few = [Simulation(parse_scene(text, "row"), ranks) for ranks in (comm, MPI.COMM_SELF)]
    records = [simulation.run(quiet=True) for simulation in with_few]
    assert records[0]["energies"]["external_work"] == pytest.approx(records[1]["energies"]["external_work"], rel=1e-9)
    assert records[0]["energies"]["external_work"] > 0


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("method", ("relaxation", "newton"))
def test_errors_are_raised_on_every_rank(comm, method):
    with pytest.raises(SceneError, match="leave 3 rigid motions"):
        Simulation(parse_scene(notched(method), "strip", ["load=[]", "probe=[]"]), comm)
    simulation = Simulation(parse_scene(notched(method, cells=(26, 15)), "strip", ["static.equilibria=2", "static.steps=3"]), comm)
    with pytest.raises(RunError, match="bonds break in each of 2 equilibria"):
        simulation.run(quiet=True)


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path", PATHS)
def test_a_piece_that_nothing_holds_is_named_on_every_rank(comm, path):
    """A frame around the strip's held half, cut out of it by a crack that winds through the ranks: what lies beyond it is one piece of 26 x 15 - 70 particles."""
    crack = '[[crack]]\ntype = "polyline"\npoints = [[-14.0, -3.5], [-3.0, -3.5], [-3.0, 3.5], [-14.0, 3.5]]\n'
    text = still((26, 15), "newton", extra=crack).replace('shape = "half_space"\npoint = [-10.0, 0.0]\nnormal = [-1.0, 0.0]', 'shape = "box"\nlower = [-13.0, -3.0]\nupper = [-10.0, 3.0]')
    with pytest.raises(SceneError) as error:
        Simulation(parse_scene(text, "strip", [f"particles.path={path}"]), comm)
    found = comm.allgather(str(error.value))
    assert "3 rigid motions free of the piece of 320 particles of body 'body' around (-12.5, -7) m, of 2 pieces" in found[0] and len(set(found)) == 1
