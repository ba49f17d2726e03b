"""A growing crack on all ranks against the same run on one, on either path, for either model."""
import numpy as np
import pytest

from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from pdhpc.simulation import Simulation
from pdhpc.study.verify.case import plate
from pdhpc.study.verify.fracture import GROWING_CRACK

PATHS = ("lattice", "cloud")
LPS = ["material.glass.model=lps", "material.glass.poissons_ratio=0.22"]
SHORT = ["time.end=14e-6", "output.history_every=2e-6", "tip.crack.window=2e-6"]


def gathered(comm, simulation):
    """Return {name: array sorted by id} of the whole body, on every rank."""
    subdomain = simulation.problem.subdomain
    particles = subdomain.particles
    parts = {"id": particles.id[: particles.n_owned], "x": subdomain.places(), "damage": subdomain.bonds.damage(), "alive": subdomain.bonds.alive()}
    for name in ("displacement", "velocity", "force_density", "dissipated"):
        parts[name] = particles.owned(getattr(particles, name))
    if subdomain.state is not None:
        parts["state"] = particles.owned(subdomain.state)
    whole = {name: np.concatenate(comm.allgather(values)) for name, values in parts.items()}
    order = np.argsort(whole["id"])
    return {name: values[order] for name, values in whole.items()}


def same_as_on_one_rank(comm, scene):
    """Run a scene on all ranks and on one; return both records after comparing every digit."""
    from mpi4py import MPI

    together, alone = Simulation(scene, comm), Simulation(scene, MPI.COMM_SELF)
    assert together.problem.dt == alone.problem.dt
    record, reference = together.run(quiet=True), alone.run(quiet=True)
    expected = gathered(MPI.COMM_SELF, alone)
    for name, values in gathered(comm, together).items():
        assert np.array_equal(values, expected[name]), name
    for name in ("energies", "broken_bonds", "particles", "bonds", "bond_evaluations", "critical_dt", "path", "tips"):
        assert record[name] == reference[name], name
    return together, record


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("overrides", [[], ["particles.kinematics=linear", "particles.influence=gaussian", "particles.volume_correction=none"], LPS], ids=["pmb", "linear", "lps"])
def test_the_same_bits_as_on_one_rank(comm, path, overrides):
    together, record = same_as_on_one_rank(comm, parse_scene(GROWING_CRACK, "crack", [*SHORT, f"particles.path={path}", *overrides]))
    assert record["path"].startswith(f"{path}: ") and record["broken_bonds"] > 100
    doubles = 2 + (overrides == LPS)  # a ghost's position, and p of a state-based law
    assert record["ghosts"] > 0 and record["sent_per_step"] == record["ghosts"]
    assert record["bytes_sent_per_step"] == 8 * doubles * record["ghosts"]


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path", PATHS)
def test_more_ranks_than_particles(comm, path):
    together, record = same_as_on_one_rank(comm, parse_scene(plate((2, 1), 2.0), "t", [f"particles.path={path}"]))
    assert record["particles"] == 2 and record["bonds"] == 1
    owned = comm.allgather(together.problem.subdomain.particles.n_owned)
    assert comm.size == 2 or min(owned) == 0


SECOND = """
[[material]]
name = "stiff"
density = 2.0
youngs_modulus = 5.0
critical_stretch = 0.02
{model}
[[body]]
name = "r"
material = "stiff"
shape = "box"
lower = {lower}
upper = {upper}
[[initial]]
velocity_gradient = {kick}
"""
KICK_3D = "[[0.02, 0.0, 0.01], [0.0, -0.01, 0.0], [0.0, 0.02, 0.0]]"
MODEL = {"pmb": "", "lps": 'model = "lps"\npoissons_ratio = 0.1'}


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("model", list(MODEL))
@pytest.mark.parametrize("path", PATHS)
def test_three_dimensions_and_two_materials(comm, path, model):
    extra = SECOND.format(model=MODEL[model], lower=[4.0, -3.0, -3.0], upper=[8.0, 3.0, 3.0], kick=KICK_3D)
    text = plate((8, 6, 6), 2.0, kinematics="finite", material="critical_stretch = 0.02\n" + MODEL[model], dimension="3d", extra=extra)
    _, record = same_as_on_one_rank(comm, parse_scene(text, "t", ["time.end=20.0", f"particles.path={path}"]))
    assert record["broken_bonds"] > 0 and record["particles"] == 12 * 6 * 6


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("model", list(MODEL))
@pytest.mark.parametrize("shift, path", [(0.0, "lattice: all bodies are filled with one lattice"), (0.25, "cloud: body 2 lies ")])
def test_bodies_on_one_lattice_and_on_shifted_ones(comm, shift, path, model):
    extra = SECOND.format(model=MODEL[model], lower=[10.0, -5.0 + shift], upper=[22.0, 3.0 + shift], kick="[[0.02, 0.01], [0.0, -0.01]]")
    text = plate((20, 12), 3.0, kinematics="finite", material="critical_stretch = 0.02\n" + MODEL[model], extra=extra)
    _, record = same_as_on_one_rank(comm, parse_scene(text, "t", ["time.end=20.0"]))
    assert record["path"].startswith(path) and record["broken_bonds"] > 0


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path", PATHS)
def test_outlines_with_holes(comm, path):
    """A disk with an eccentric hole and, apart from it, a box that no bond reaches."""
    text = plate((6, 4), 3.0, kinematics="finite", material="critical_stretch = 0.01", extra="[[initial]]\nvelocity_gradient = [[0.03, 0.01], [0.0, -0.01]]\n")
    disk = '[[body]]\nname = "disk"\nmaterial = "solid"\nshape = "disk"\ncenter = [30.0, 3.0]\nradius = 13.0\n'
    disk += '[[body.hole]]\nshape = "disk"\ncenter = [33.0, 3.0]\nradius = 6.0\n'
    _, record = same_as_on_one_rank(comm, parse_scene(text.replace("[time]", disk + "[time]"), "t", ["time.end=10.0", f"particles.path={path}"]))
    assert record["broken_bonds"] > 100


@pytest.mark.mpi(min_size=2)
def test_probes_tips_and_history_have_the_same_digits(comm):
    """Sums over a region that several ranks share, written row by row."""
    import shutil
    import tempfile
    from pathlib import Path

    from mpi4py import MPI

    scene = parse_scene(GROWING_CRACK, "crack", [*SHORT, *LPS])
    folder = Path(comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None))
    Simulation(scene, comm).run(folder / "together", quiet=True)
    Simulation(scene, MPI.COMM_SELF).run(folder / f"alone{comm.rank}", quiet=True)
    rows = [(folder / name / "history.csv").read_text() for name in ("together", f"alone{comm.rank}")]
    comm.Barrier()
    if comm.rank == 0:
        shutil.rmtree(folder, ignore_errors=True)
    assert rows[0] == rows[1] and len(rows[0].splitlines()) == 10  # header, start, every 2 of 14 microseconds, and the two frames (7 us and the last)


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path", PATHS)
def test_an_empty_region_is_an_error_on_every_rank(comm, path):
    extra = '[[region]]\nname = "r"\nshape = "box"\nlower = [0.1, 0.1]\nupper = [0.2, 0.2]\n[damage]\nno_fail = ["r"]\n'
    with pytest.raises(SceneError, match="selects no particle"):
        Simulation(parse_scene(plate((8, 8), extra=extra), "t", [f"particles.path={path}"]), comm)
