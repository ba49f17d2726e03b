import numpy as np
import pytest

from pdhpc.parallel.linear_solver import SolverError
from pdhpc.study.verify.case import problem_of
from pdhpc.study.verify.static import still
from pdhpc.warm_up import MODELS, PATHS
from tests.unit.peridynamics.test_equilibrium import PULL, RAMP

STRETCH = PULL.format(kind="displacement", value=1.0, more=RAMP)


def newton(extra=STRETCH, overrides=(), **options):
    return problem_of(still((14, 6), "newton", extra=extra, **options), list(overrides)).stepper()


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("model", MODELS)
def test_residuals_fall_as_newton_s_do(model, path):
    """A stretch by a tenth: once close, the residual falls faster than the linear systems are solved to (1e-4), down to rounding."""
    stepper, found = newton(overrides=[f"particles.path={path}", "static.tolerance=1e-11"], model=model, kinematics="finite"), []
    measure = stepper.measure

    def watched():
        out = measure()
        found.append(stepper.residual)
        return out

    stepper.measure = watched
    stepper.advance()
    assert 3 <= stepper.iterations <= 6 and stepper.residual <= 1e-11
    falls = np.array(found[2:]) / np.array(found[1:-1])
    assert falls.max() < 0.1 and falls.min() < 1e-3, found


@pytest.mark.parametrize("kinematics, most", (("linear", 1), ("finite", 4)))
def test_free_particles_follow_moving_supports_at_once(kinematics, most):
    """Where the tangent is all there is, one step from equilibrium to equilibrium suffices."""
    stepper = newton(kinematics=kinematics, steps=4)
    stepper.advance()
    stepper.advance()
    assert 1 <= stepper.iterations <= most and stepper.residual <= 1e-10


@pytest.mark.parametrize("kinematics, path", (("linear", "cloud"), ("finite", "lattice")))
@pytest.mark.parametrize("model", MODELS)
def test_the_stiffness_is_symmetric_and_positive(model, kinematics, path):
    stepper = newton(overrides=[f"particles.path={path}"], model=model, kinematics=kinematics)
    stepper.advance()
    x, y = np.random.default_rng(0).standard_normal((2, stepper.held.size))
    image_x, image_y = stepper._stiffness(x).ravel().copy(), stepper._stiffness(y).ravel().copy()
    tolerance = 1e-12 if kinematics == "linear" else 1e-6
    assert y @ image_x == pytest.approx(x @ image_y, rel=tolerance, abs=tolerance * np.linalg.norm(image_x) * np.linalg.norm(y)) and x @ image_x > 0
    held = stepper.held.ravel()
    assert np.array_equal(image_x[held], stepper._unit * x[held])


def test_blocks_are_inverted_and_held_components_stand_alone():
    stepper = newton()
    inverses = stepper._inverse_blocks()
    assert np.linalg.eigvalsh(inverses).min() > 0
    row = int(np.flatnonzero(stepper.held[:, 0])[0])
    assert inverses[row] == pytest.approx(np.eye(2) / stepper._unit)


def test_a_particle_without_bonds_stays(lose_bonds):
    stepper = newton()
    row = stepper.view.n // 2 - 3
    arrays = stepper.subdomain.bonds.arrays
    mate = [i for i in range(stepper.view.n) if i != row]
    lose_bonds(stepper.subdomain, row)
    slot, slots = stepper.subdomain.particles.slots[row], stepper.subdomain.particles.slots
    for k, offset in enumerate(arrays.offset):
        neighbours = slots[mate] + offset == slot
        arrays.alive[k // 64, slots[mate][neighbours]] &= ~(np.uint64(1) << np.uint64(k % 64))
    assert not stepper.held[row].any()
    stepper.advance()
    assert np.all(stepper.view.field("displacement")[row] == 0.0) and stepper.residual <= 1e-10


def test_a_tolerance_below_rounding_is_an_error_with_its_numbers():
    with pytest.raises(SolverError, match=r"load step 1 \(t = 1 s\) found no equilibrium: .* out of balance by .* a Newton step of 1/256 brings it no closer"):
        newton(overrides=["static.tolerance=1e-18"]).advance()


def test_a_ksp_that_does_not_converge_is_an_error_with_its_numbers():
    from petsc4py import PETSc

    PETSc.Options()["static_ksp_max_it"] = 2
    try:
        with pytest.raises(SolverError, match=r"load step 1 \(t = 1 s\): the KSP static_ did not converge in 2 iterations"):
            newton().advance()
    finally:
        PETSc.Options().delValue("static_ksp_max_it")


def test_too_few_iterations_are_an_error():
    with pytest.raises(SolverError, match="after 1 iterations .* take more load steps"):
        newton(overrides=["static.iterations=1"], kinematics="finite").advance()
