"""Load stepping, by both methods."""
import numpy as np
import pytest

from pdhpc.parallel.linear_solver import SolverError
from pdhpc.study.verify.case import problem_of
from pdhpc.study.verify.static import METHODS, notched, still
from pdhpc.warm_up import MODELS, PATHS

PULL = '[[region]]\nname = "end"\nshape = "half_space"\npoint = [5.0, 0.0]\nnormal = [1.0, 0.0]\n[[load]]\ntype = "{kind}"\nregion = "end"\nvalue = [{value}, 0.0]\n{more}'
RAMP = 'time = { function = "ramp", end = 1.0 }\n'


def dense_solution(problem, load, omega=lambda r: np.minimum(1.0, 3.5 - r), factor=1.0):
    """Return displacements (n, 2) at which a bond-based body held as the problem says bears a load density (n, 2): a matrix over all pairs, solved densely.

    omega : of distances, with the volume correction. factor : of each pair, or one for all.
    """
    subdomain, law = problem.subdomain, problem.body.law
    x, held = subdomain.places(), problem.conditions.held().ravel()
    volume, n = subdomain.particles.owned(subdomain.particles.volume), len(x)
    xi = x[None] - x[:, None]
    r = np.linalg.norm(xi, axis=2)
    near = (r > 0) & (r < 3.5)
    r = np.where(near, r, 1.0)
    weight = np.where(near, law.micromodulus[0, 0] * factor * omega(r) / r**3 * volume[None] * volume[:, None], 0.0)
    blocks = weight[:, :, None, None] * xi[:, :, :, None] * xi[:, :, None, :]
    matrix = -blocks
    matrix[np.arange(n), np.arange(n)] = blocks.sum(axis=1)
    matrix = matrix.transpose(0, 2, 1, 3).reshape(2 * n, 2 * n)
    u = np.zeros(2 * n)
    u[~held] = np.linalg.solve(matrix[np.ix_(~held, ~held)], (volume[:, None] * load).ravel()[~held])
    return u.reshape(n, 2)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("method", METHODS)
def test_a_load_is_borne_as_the_dense_matrix_says(method, path):
    problem = problem_of(still((14, 6), method, extra=PULL.format(kind="force_density", value=1e-3, more="")), [f"particles.path={path}"])
    stepper = problem.stepper()
    stepper.advance()
    load = np.where(problem.subdomain.places()[:, :1] > 5.0, [[1e-3, 0.0]], 0.0)
    expected = dense_solution(problem, load)
    assert np.abs(stepper.view.field("displacement") - expected).max() < 1e-8 * np.abs(expected).max()
    assert stepper.residual <= 1e-10 and stepper.step == 1 and stepper.time == 1.0 and stepper.equilibria == 1 and stepper.broken == 0
    held = problem.conditions.held()
    force = stepper.view.field("force_density")
    assert -force[held].reshape(-1, 2)[:, 0].sum() == pytest.approx(-load[:, 0].sum(), rel=1e-9), "supports bear the load"


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("path, correction", [("lattice", "none"), ("cloud", "none"), ("cloud", "energy")])
def test_the_conical_influence_and_its_surface_correction_as_the_dense_matrix_says(method, path, correction):
    options = [f"particles.path={path}", "particles.influence=conical", f"particles.surface_correction={correction}"]
    problem = problem_of(still((14, 6), method, extra=PULL.format(kind="force_density", value=1e-3, more="")), options)
    factor = np.ones((84, 84))
    if correction == "energy":
        arrays, counts = problem.subdomain.bonds.arrays, problem.subdomain.bonds.family_size
        for i, (first, count) in enumerate(zip(arrays.row_start, counts)):
            factor[i, arrays.neighbour[first : first + count]] = arrays.factor[first : first + count]
        assert factor.max() > 1.2 and np.array_equal(factor, factor.T)
    stepper = problem.stepper()
    stepper.advance()
    load = np.where(problem.subdomain.places()[:, :1] > 5.0, [[1e-3, 0.0]], 0.0)
    expected = dense_solution(problem, load, lambda r: np.maximum(0.0, 1.0 - r / 3.0), factor)
    assert np.abs(stepper.view.field("displacement") - expected).max() < 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("kinematics, bound", (("linear", 1e-9), ("finite", 2e-4)))
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("method", METHODS)
def test_work_of_loads_and_supports_is_stored(method, model, kinematics, bound):
    """Exactly in linear kinematics; by the trapezium over 4 steps in finite ones."""
    extra = PULL.format(kind="displacement", value=0.1, more=RAMP) + '[[load]]\ntype = "gravity"\nvalue = [0.0, -1e-4]\n'
    stepper = problem_of(still((14, 6), method, model, kinematics, extra=extra, steps=4)).stepper()
    for _ in range(4):
        stepper.advance()
    sums = {name: values.sum() for name, values in stepper.ledger().items()}
    assert sums["external_work"] == pytest.approx(sums["strain_energy"], rel=bound) and sums["strain_energy"] > 0
    assert sums["kinetic_energy"] == sums["dissipated_energy"] == 0.0


def test_residual_is_over_the_largest_force_so_far():
    problem = problem_of(still((14, 6), "newton", extra=PULL.format(kind="force_density", value=1e-3, more='time = { function = "table", times = [0.0, 0.5, 1.0], values = [0.0, 1.0, 0.0] }\n'), steps=2))
    stepper = problem.stepper()
    stepper.advance()
    load = 1e-3 * np.sqrt((problem.subdomain.places()[:, 0] > 5.0).sum())
    reactions = np.linalg.norm(stepper.view.field("force_density")[problem.conditions.held()])
    assert stepper.reference == pytest.approx(max(load, reactions))
    stepper.advance()
    assert stepper.reference == pytest.approx(max(load, reactions)) and stepper.residual <= 1e-10
    assert np.abs(stepper.view.field("displacement")).max() < 1e-8, "unloaded, it stands where it stood"


@pytest.mark.parametrize("kinematics", ("linear", "finite"))
@pytest.mark.parametrize("method", METHODS)
def test_an_unloaded_body_is_in_equilibrium(method, kinematics):
    extra = PULL.format(kind="displacement", value=0.1, more='time = { function = "ramp", start = 0.5, end = 1.0 }\n')
    stepper = problem_of(still((14, 6), method, kinematics=kinematics, extra=extra, steps=2)).stepper()
    stepper.advance()
    assert stepper.iterations == 0 and stepper.residual == 0.0 and np.all(stepper.view.field("displacement") == 0.0)
    stepper.advance()
    assert stepper.iterations > 0 and stepper.residual <= 1e-10


def torn(breaking="all", equilibria=500, **options):
    stepper = problem_of(notched("newton", breaking, **options), [f"static.equilibria={equilibria}"]).stepper()
    while stepper.broken == 0:
        stepper.advance()
    return stepper


@pytest.mark.parametrize("model", MODELS)
def test_energy_that_leaves_with_broken_bonds_is_booked(model):
    stepper = torn(model=model)
    sums = {name: values.sum() for name, values in stepper.ledger().items()}
    assert sums["strain_energy"] + sums["dissipated_energy"] == pytest.approx(sums["external_work"], rel=1e-6)
    assert stepper.damped().sum() > 0.01 * sums["dissipated_energy"] and stepper.broken_in_step == stepper.broken // 2 > 10 and stepper.equilibria > 2
    assert stepper.totals["equilibria"] == stepper.equilibria + stepper.step - 1 and "bonds broke in" in stepper.note


def test_the_most_strained_bonds_break_first():
    """Of the bonds beyond their limit only those of the largest s/s0, but for 1 %, break in the first equilibrium; in the end both ways tear the strip."""
    every, some = torn(), torn("most_strained")
    assert some.equilibria > every.equilibria
    first = []
    for breaking in ("all", "most_strained"):
        stepper = problem_of(notched("newton", breaking, steps=1)).stepper()
        stepper._find_loads(1.0)
        stepper.bring_to_rest(1.0, False)
        first.append(stepper._break_bonds())
    assert 0 < first[1] < 0.2 * first[0]


def test_a_body_that_fails_stops_with_its_numbers():
    with pytest.raises(SolverError, match=r"load step 3 \(t = 0.3 s\): bonds break in each of 3 equilibria, \d+ so far and \d+ in the last.*static.equilibria"):
        torn(equilibria=3)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("method", METHODS)
def test_state_continues_a_run_bit_for_bit(method, path):
    text, path = notched(method), [f"particles.path={path}"]
    first, second = problem_of(text, path).stepper(), problem_of(text, path).stepper()
    for _ in range(7):
        first.advance()
    assert first.broken > 0
    saved = {key: np.copy(get()) for key, (get, *_) in first.state().items()}
    for key, (_, put, *_) in second.state().items():
        put(saved[key] if saved[key].ndim else saved[key].item())
    first.advance()
    second.advance()
    assert second.step == 8 and np.array_equal(first.view.field("displacement"), second.view.field("displacement"))
    for name, values in first.ledger().items():
        assert np.array_equal(values, second.ledger()[name]), name



@pytest.mark.parametrize("method", METHODS)
def test_loads_within_the_rounding_of_positions_are_refused(method):
    """Forces of strains of 1e-16 cannot be found from positions of sixteen digits; displacements can (linear kinematics)."""
    text = still((14, 6), method, kinematics="finite", extra=PULL.format(kind="force_density", value=1e-15, more=""))
    with pytest.raises(SolverError, match=r"forces below .* N are the rounding of positions; particles.kinematics = \"linear\" is not limited by it"):
        problem_of(text, ["static.iterations=2000"]).stepper().advance()
    stepper = problem_of(text, ["particles.kinematics=linear"]).stepper()
    stepper.advance()
    assert stepper.residual <= 1e-10


@pytest.mark.parametrize("method", METHODS)
def test_the_residual_is_true_where_rounding_limits_it(method):
    stepper = problem_of(still((14, 6), method, kinematics="finite", extra=PULL.format(kind="force_density", value=1e-9, more=""))).stepper()
    stepper.advance()
    force = np.where(stepper.held, 0.0, stepper.view.field("force_density"))
    assert stepper.residual == pytest.approx(np.linalg.norm(force) / stepper.reference, rel=1e-6) and stepper.residual > 0.0
    assert stepper.totals["rounding_residual"] == (stepper.residual if stepper.residual > stepper.path.tolerance else 0.0)
