"""A growing crack on all ranks against the same run on one, on either path, for either model."""
import platform

import numpy as np
import pytest

from pdhpc.provenance import introduction
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
def test_a_log_says_how_ranks_share_the_body(comm):
    """40 x 40 particles in all; the job is on this machine alone."""
    simulation = Simulation(parse_scene(plate((40, 40)), "p", ["output.frames=1"]), comm)
    lines, own = introduction(simulation), simulation.problem.share()
    assert simulation.hosts == {platform.node(): comm.size} and comm.allreduce(own["particles"]) == 1600
    shares = comm.gather(own)
    if comm.rank == 0:
        assert f"{comm.size} ranks: {comm.size} on {platform.node()}" in lines
        counts = [each["particles"] for each in shares]
        assert any(line.startswith(f"a rank has particles {min(counts)} to {max(counts)} (mean {1600 / comm.size:,.1f}), ghosts ") for line in lines)
        assert all(any(line.startswith(f"rank {rank}: {count} particles, {shares[rank]['ghosts']} ghosts") for line in lines) for rank, count in enumerate(counts))


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


MESH = """
model = "fem"
dimension = "{dimension}"
[mesh]
cell_size = 0.5
[[material]]
name = "soft"
density = 1.0
youngs_modulus = 1.0
[[material]]
name = "hard"
density = 2.0
youngs_modulus = 5.0
[[body]]
name = "a"
material = "soft"
shape = "box"
lower = {zero}
upper = {one}
[[body.hole]]
shape = "box"
lower = {in_hole}
upper = {out_hole}
[[body]]
name = "b"
material = "hard"
shape = "box"
lower = {second}
upper = {far}
[[region]]
name = "left"
shape = "half_space"
point = {near}
normal = {down}
[[load]]
type = "displacement"
region = "left"
value = {zero}
[[load]]
type = "gravity"
value = {pull}
[[load]]
type = "traction"
region = "all"
face = "+y"
value = {pull}
[[probe]]
name = "grip"
region = "left"
quantity = "reaction"
[[probe]]
name = "mean"
region = "all"
quantity = "stress"
[time]
end = 2.0
"""
PLACES = {
    2: dict(dimension="plane_strain", zero=[0.0, 0.0], one=[4.0, 3.0], in_hole=[1.0, 1.0], out_hole=[2.0, 2.0], second=[4.0, 0.0], far=[6.0, 3.0], near=[0.1, 0.0], down=[-1.0, 0.0],
            pull=[0.1, -0.2]),
    3: dict(dimension="3d", zero=[0.0] * 3, one=[3.0, 2.0, 2.0], in_hole=[1.0, 0.5, 0.5], out_hole=[2.0, 1.5, 1.5], second=[3.0, 0.0, 0.0], far=[4.0, 2.0, 2.0],
            near=[0.1, 0.0, 0.0], down=[-1.0, 0.0, 0.0], pull=[0.1, -0.2, 0.3]),
}
LATTICE = ["fem.moduli=lattice", 'particles={spacing=0.125, horizon=0.4}']


def vertices_of(comm, simulation):
    """Return {name: array sorted by id} of all vertices, on every rank."""
    view = simulation.stepper.view
    view.prepare()
    parts = {"id": view.ids, "x": view.places(), "volume": view.volume}
    parts.update({name: view.field(name) for name in ("displacement", "velocity", "stress", "strain", "force_density")})
    whole = {name: np.concatenate(comm.allgather(values)) for name, values in parts.items()}
    order = np.argsort(whole["id"])
    return {name: values[order] for name, values in whole.items()}


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("dim, overrides, tolerance", [
    (2, [], 0.0), (3, [], 0.0), (2, LATTICE, 1e-12), (2, ["fem.integration=newmark"], 1e-7), (3, ["fem.integration=static"], 1e-7),
], ids=["2d", "3d", "lattice", "newmark", "static"])
def test_a_mesh_on_all_ranks_and_on_one(comm, dim, overrides, tolerance):
    """Explicit steps have the same bits, with moduli of the lattice but for rounding; implicit ones agree to the KSP's tolerance."""
    from mpi4py import MPI

    scene = parse_scene(MESH.format(**PLACES[dim]), "t", overrides)
    runs = Simulation(scene, comm), Simulation(scene, MPI.COMM_SELF)
    records = [run.run(quiet=True) for run in runs]
    together, alone = vertices_of(comm, runs[0]), vertices_of(MPI.COMM_SELF, runs[1])
    for name, values in together.items():
        scale = np.abs(alone[name]).max(initial=0.0)
        assert np.abs(values - alone[name]).max() <= tolerance * scale, name
    for name in ("cells", "vertices", "dofs", "steps"):
        assert records[0][name] == records[1][name], name
    for name in ("dt", "critical_dt"):
        assert records[0][name] == pytest.approx(records[1][name], rel=tolerance, abs=0.0), name
    assert records[0]["energies"] == pytest.approx(records[1]["energies"], rel=max(tolerance, 1e-300), abs=1e-9 if tolerance else 0.0) and records[0]["energies"]["external_work"] > 0
    probes = [[probe.read(run.stepper) for probe in run.probes] for run in runs]
    assert np.allclose(probes[0][0] + probes[0][1], probes[1][0] + probes[1][1], rtol=max(tolerance, 1e-13), atol=1e-7)
    assert records[0]["ghosts"] > 0


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("overrides, words", [
    (['mesh={file="no.msh"}', 'body=[{name="a", material="soft", shape="mesh"}]', "material=[{name='soft', density=1.0, youngs_modulus=1.0}]"], "there is no mesh"),
    (["time.dt=1.9"], "time.dt = 1.9 s"), (["load=[]", "probe=[]", "region=[]", "fem.integration=static"], "leave 3 rigid motions"),
])
def test_bad_meshes_are_an_error_on_every_rank(comm, overrides, words):
    with pytest.raises(SceneError, match=words):
        Simulation(parse_scene(MESH.format(**PLACES[2]), "t", overrides), comm)
