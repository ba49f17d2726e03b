"""Elements enriched by particles: any number of ranks gives the same, a stored state goes on, and verification runs on all ranks together."""
import numpy as np
import pytest

from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
import pdhpc.study.verify.gfem_fracture  # noqa: F401  (registers its cases)
import pdhpc.study.verify.gfem_poster  # noqa: F401
from pdhpc.study.verify.case import CASES
from pdhpc.study.verify.mts import field_by_id

SQUARE = """
model = "gfem"
dimension = "plane_stress"
[particles]
spacing = 1.0
horizon = 3.015
kinematics = "linear"
[mesh]
cell_size = 5.0
[[material]]
name = "soft"
density = 1.0
youngs_modulus = 1.0
critical_stretch = 0.02
[time]
end = 1e4
dt = 3.0
"""
EDGES = """
[[region]]
name = "top"
shape = "box"
lower = [-1.0, 39.0]
upper = [71.0, 41.0]
[[region]]
name = "bottom"
shape = "box"
lower = [-1.0, -1.0]
upper = [71.0, 1.0]
"""
BODY = '[[body]]\nname = "plate"\nmaterial = "soft"\nshape = "box"\nlower = [0.0, 0.0]\nupper = [60.0, 40.0]\n'
CRACK = '[[crack]]\ntype = "polyline"\npoints = [[-1.0, {y}], [{x}, {y}]]\n'
_TRACTION = '[[load]]\ntype = "traction"\nregion = "{}"\nface = "{}"\nvalue = [0.0, {}]\n'
PULL = EDGES + _TRACTION.format("top", "+y", 4e-3) + _TRACTION.format("bottom", "-y", -4e-3) + '[damage]\nno_fail = ["top", "bottom"]\n'
MOVED = EDGES + """
[[load]]
type = "displacement"
region = "top"
value = ["free", 0.25]
time = { function = "ramp", end = 200.0 }
[[load]]
type = "velocity"
region = "bottom"
value = [1e-4, -1e-3]
"""
TWO = """
[[material]]
name = "stiff"
density = 2.0
youngs_modulus = 3.0
critical_stretch = 0.015
[[body]]
name = "left"
material = "soft"
shape = "box"
lower = [0.0, 0.0]
upper = [40.0, 40.0]
[[body.hole]]
shape = "box"
lower = [20.0, 10.0]
upper = [30.0, 15.0]
[[body]]
name = "right"
material = "stiff"
shape = "box"
lower = [40.0, 0.0]
upper = [60.0, 40.0]
[[initial]]
region = "all"
velocity_gradient = [[0.0, 1e-4], [0.0, 1.2e-3]]
origin = [0.0, 20.0]
"""
SCENES = {
    "growth": SQUARE + BODY + CRACK.format(x=20.0, y=20.0) + PULL,
    "prescribed motion": SQUARE + BODY + CRACK.format(x=20.0, y=20.0) + MOVED,
    "hole, two materials, thrown": SQUARE + TWO + CRACK.format(x=12.0, y=20.0),
}
SCHEMES = ("pinned", "galerkin")


def made(comm, text, scheme, overrides=()):
    """Return the CoupledStep of a scene."""
    return build(parse_scene(text, "scene", [f"gfem.scheme={scheme}", *overrides]), comm).stepper()


def seen(comm, stepper):
    """Return ({field: values by id}, chosen vertices, broken directed bonds) on every rank."""
    stepper.view.prepare()
    fields = {name: field_by_id(stepper.view, stepper.view.field(name), comm) for name in ("displacement", "velocity", "damage", "strain_energy_density")}
    mesh, n = stepper.solution.mesh, stepper.solution.mesh.n_owned
    chosen = np.sort(np.concatenate(comm.allgather(mesh.vertex_id[:n][stepper.patches.chosen[:n]])))
    return fields, chosen, comm.allreduce(stepper.broken)


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("name", list(SCENES))
def test_any_number_of_ranks_gives_the_same(comm, name, scheme):
    """To round-off: of galerkin's CG, which stops at 1e-12 of the right side, and of sums at vertices that ranks share; the bonds that break are the same."""
    from mpi4py import MPI

    stepper, alone = made(comm, SCENES[name], scheme), made(MPI.COMM_SELF, SCENES[name], scheme)
    before = len(seen(comm, stepper)[1])
    for _ in range(60):
        stepper.advance()
        alone.advance()
    (fields, chosen, broken), (expected, chosen_alone, broken_alone) = seen(comm, stepper), seen(MPI.COMM_SELF, alone)
    assert broken == broken_alone > 100
    assert np.array_equal(chosen, chosen_alone) and len(chosen) > before
    assert np.array_equal(fields.pop("damage"), expected["damage"])
    for field, values in fields.items():
        assert np.abs(values - expected[field]).max() <= 1e-9 * np.abs(expected[field]).max(), field
    assert stepper.failure is None and stepper.ghost_force() == pytest.approx(alone.ghost_force(), rel=1e-9)
    ranks_with_cells = comm.allreduce(int(len(stepper.local.cells) > 0))
    assert ranks_with_cells > 1, "the crack crosses borders of ranks"


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_ranks_without_a_patch(comm, scheme):
    """A notch in a corner that does not grow: elements on all other ranks; and a body without any patch."""
    from mpi4py import MPI

    for notch in (True, False):
        text = (SQUARE + BODY + (CRACK.format(x=3.0, y=38.0) if notch else "") + PULL).replace("critical_stretch = 0.02", "")
        stepper, alone = made(comm, text, scheme), made(MPI.COMM_SELF, text, scheme)
        assert comm.allreduce(int(len(stepper.local.cells) == 0)) >= (1 if notch else comm.size)
        for _ in range(30):
            stepper.advance()
            alone.advance()
        found, expected = seen(comm, stepper)[0]["displacement"], seen(MPI.COMM_SELF, alone)[0]["displacement"]
        assert np.abs(found - expected).max() <= 1e-11 * np.abs(expected).max()


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("name", list(SCENES))
def test_a_stored_state_goes_on(comm, name, scheme):
    """Bit for bit on the same ranks, patches that grew before and after included."""
    stepper = made(comm, SCENES[name], scheme)
    for _ in range(30):
        stepper.advance()
    saved = {key: np.copy(get()) for key, (get, *_) in stepper.state().items()}
    again = made(comm, SCENES[name], scheme)
    for key, (_, put, *_) in again.state().items():
        put(saved[key])
    again.resume()
    for each in (stepper, again):
        for _ in range(30):
            each.advance()
    (fields, chosen, _), (expected, chosen_before, broken) = seen(comm, again), seen(comm, stepper)
    assert broken > 0 and np.array_equal(chosen, chosen_before)
    for field, values in fields.items():
        assert np.array_equal(values, expected[field]), field
    for key, values in again.ledger().items():
        assert comm.allreduce(values.sum()) == pytest.approx(comm.allreduce(stepper.ledger()[key].sum()), rel=1e-12), key


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("name", (
    "gfem_ghost_force", "gfem_collar", "gfem_everywhere", "gfem_free", "gfem_fracture", "gfem_poster", "gfem_poster_functions", "gfem_instant",
))
def test_verification_on_all_ranks(comm, name):
    """More than two ranks would only share less work: the tests above are for them."""
    if comm.size > 2:
        pytest.skip("on two ranks")
    failures = [f"{check.what}: {check.measured!r}, expected {check.expected!r}" for check in CASES[name].function() if not check.passed]
    assert not failures, failures
