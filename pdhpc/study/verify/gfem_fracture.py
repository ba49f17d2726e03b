"""Coupled runs of the pre-cracked plate against particles everywhere: loaded, swinging freely, breaking."""
from functools import lru_cache

import numpy as np

from pdhpc.parallel.comm import exact_sum, world
from pdhpc.study.verify.case import Check, at_most, case
from pdhpc.study.verify.gfem import share
from pdhpc.study.verify.gfem_control import make_outer
from pdhpc.study.verify.gfem_plate import CELL, CRACK, HEIGHT, QUARTERS, Plate, energy_of, errors, observe, run_coupled, run_full, set_in_motion, words

_SCHEMES = ("pinned", "galerkin")
_SOURCE = "particles everywhere"
_LOAD = 0.002  # Pa, one tenth of E times the critical stretch: about as many bonds break by T = 2.6 at H/h = 5 as in the prototype
_STRENGTH = 0.02
_FREE_BOUNDS = (0.02, 0.03, 0.06, 0.06)


@case
def gfem_loaded():
    """A crack that does not grow in a plate pulled at its edges: errors at four times"""
    checks, body = [], Plate(5, 4, 2.6, 0.004)
    for scheme in _SCHEMES:
        result, dt = run_coupled(body, f"gfem.scheme={scheme}")
        found = errors(result, run_full(body, dt, len(result.tip)))
        checks += [at_most(f"{scheme}: error of the displacement at {when}", error, 0.015, _SOURCE) for when, error in zip(QUARTERS, found)]
    return checks


def _swing(x):
    """Return the velocity that sets the plate, and the faces of its crack against each other, in free vibration."""
    along, across = np.cos(np.pi * x[:, 0]), np.pi * x[:, 1] / HEIGHT
    opening = np.sign(x[:, 1] - HEIGHT / 2) * np.sqrt(np.clip((CRACK - x[:, 0]) / CRACK, 0.0, 1.0))
    return 0.01 * np.stack([np.sin(across) * along, np.cos(across) * along + 0.5 * opening], axis=1)


def _near_crack(mesh):
    """Return (n_owned_cells,) bool: four rows of cells along the crack, to six cells ahead of its tip."""
    centre = mesh.points[mesh.cells[: mesh.n_owned_cells]].mean(axis=1)
    return (np.abs(centre[:, 1] - HEIGHT / 2) < 2 * CELL) & (centre[:, 0] < CRACK + 6 * CELL)


@lru_cache(maxsize=4)
def _swinging_particles(body, dt, n_steps):
    """Return (Result of particles everywhere, their energy at the start). Collective."""
    full = body.full(dt / body.k)
    particles = full.subdomain.particles
    particles.put(particles.velocity, _swing(full.subdomain.places()))
    stepper = full.stepper()
    start = energy_of(stepper.view)
    return observe(stepper, n_steps, body.k), start


def _swinging(body, scheme, make=None):
    """Return (errors, energies over that of the particles at the start) at four times; make : function of a CoupledProblem -> another stepper. Collective."""
    problem = body.coupled(f"gfem.scheme={scheme}")
    stepper = problem.stepper() if make is None else make(problem)
    stepper.patches.add(_near_crack(stepper.solution.mesh))
    stepper.follow()
    set_in_motion(stepper, np.zeros_like, _swing, body)
    result = observe(stepper, problem.n_steps)
    reference, start = _swinging_particles(body, problem.dt, problem.n_steps)
    return errors(result, reference), result.energy / start


def _within(numbers, least, most):
    return all(least <= each <= most for each in numbers)


def _free_checks(body, bounds, schemes, ranges):
    """Return the Checks of free vibration: errors at most `bounds` (where there are any), energies within the ranges of the schemes."""
    checks = []
    for scheme in schemes:
        error, energy = _swinging(body, scheme)
        checks += [at_most(f"{scheme}: error of the displacement at {when}", found, bound, _SOURCE) for when, found, bound in zip(QUARTERS, error, bounds)]
        least, most = ranges[scheme]
        what = f"{scheme}: energy over that at the start {words(energy)}, in [{least}, {most}] (errors {words(error)})"
        checks.append(share(_within(energy, least, most), what, "energy"))
    return checks


@case
def gfem_free():
    """Free vibration of the cracked plate, T = 2.6: errors and energy; without the standard functions inside the patches it must fail"""
    body = Plate(5, 4, 2.6)
    checks = _free_checks(body, _FREE_BOUNDS, _SCHEMES, {"pinned": (0.94, 1.01), "galerkin": (0.97, 1.03)})
    worst = _swinging(body, "pinned", make_outer)[0]
    return [*checks, share(worst.max() > 0.5, f"control, pinned without the standard functions of J: errors {words(worst)} exceed 0.5", "prototype")]


@case(slow=True)
def gfem_free_long():
    """Free vibration of the cracked plate, T = 10: energy, which the galerkin scheme lets grow by up to 12 %"""
    return _free_checks(Plate(5, 4, 10.0), (), _SCHEMES, {"pinned": (0.85, 1.01), "galerkin": (0.97, 1.12)})


def _still(body, *settings):
    """Return (4,), energies over that of the first step, of the smallest patches around a crack that does not grow. Collective."""
    problem = body.coupled(*settings)
    stepper = problem.stepper()
    set_in_motion(stepper, np.zeros_like, _swing, body)
    energies = []
    for step in range(problem.n_steps):
        stepper.advance()
        if step == 0 or (step + 1) % (problem.n_steps // 4) == 0:
            ledger = stepper.ledger()
            energies.append(exact_sum(world(), np.concatenate([ledger["kinetic_energy"], ledger["strain_energy"]])))
    return np.array(energies[1:5]) / energies[0]


@case(slow=True)
def gfem_still():
    """A crack stands still in the smallest patches, T = 30, pinned: at H/h = 5, 10, 15 energy only falls; at 0.8 of the mesh's own step it grows at 10"""
    checks = []
    for ratio in (5, 10, 15):
        energy = _still(Plate(ratio, "auto", 30.0))
        checks.append(share(_within(energy, 0.85, 1.001), f"H/h = {ratio}: energy over that of the first step {words(energy)}, in [0.85, 1.001]", "energy"))
    body = Plate(10, 8, 10.0)
    dt = 0.8 * body.coupled().critical_dt * 2.0**0.5
    grown = _still(body, f"time.dt={dt!r}", "time.allow_unstable=true")
    return [*checks, share(grown[-1] > 10.0, f"control, H/h = 10 at 0.8 of the mesh's own step: {words(grown)}, above 10", "measured")]


@case(slow=True)
def gfem_free_fine():
    """Free vibration of the cracked plate at H/h = 10, k = 8, T = 2.6: errors and energy"""
    return _free_checks(Plate(10, 8, 2.6), _FREE_BOUNDS, _SCHEMES, {"pinned": (0.94, 1.01), "galerkin": (0.97, 1.03)})


def _sensitivities(body, dt, n_steps):
    """Return (reference, errors of half its step, errors of 0.1 % more load), all with particles everywhere. Collective."""
    reference = run_full(body, dt, n_steps)
    halved, heavier = run_full(body, dt, n_steps, True), run_full(body._replace(load=1.001 * body.load), dt, n_steps)
    return reference, errors(halved, reference), errors(heavier, reference)


@case
def gfem_fracture():
    """The plate breaks, T = 1.5, k = 4: errors, crack tip, broken bonds and work, beside two sensitivities of particles everywhere"""
    checks, body = [], Plate(5, 4, 1.5, _LOAD, _STRENGTH)
    for scheme in _SCHEMES:
        result, dt = run_coupled(body, f"gfem.scheme={scheme}")
        reference, halved, heavier = _sensitivities(body, dt, len(result.tip))
        beside = f"(half step {words(halved)}, 0.1 % more load {words(heavier)})"
        for when, found, bound in zip(QUARTERS, errors(result, reference), (0.02, 0.02, 0.02, 0.06)):
            checks.append(at_most(f"{scheme}: error of the displacement at {when} {beside if when == 'T' else ''}".strip(), found, bound, _SOURCE))
        checks += _crack_checks(scheme, body, result, reference, 0.05)
        apart = np.abs(result.tip - reference.tip).max() / body.spacing
        checks.append(share(apart < 4, f"{scheme}: tips at most {apart:.1f} h apart, less than 4", _SOURCE))
        part = result.particle_steps / (reference.u.shape[1] * body.k * len(result.tip))
        checks.append(share(part < 0.35, f"{scheme}: {part:.3f} of the particle steps of particles everywhere, less than 0.35", _SOURCE))
    return checks


def _crack_checks(scheme, body, result, reference, allowed):
    """Return the Checks that about as many bonds broke as in the reference, and some."""
    return [
        Check(f"{scheme}: broken bonds", result.broken, reference.broken, allowed, _SOURCE),
        share(reference.broken > 300, f"{reference.broken} bonds break with particles everywhere", "a case that tests something"),
    ]


def _long_checks(body):
    """Return the Checks of a long run of a growing crack, whose error is held against what particles everywhere do with half the step, or 0.1 % more load."""
    checks = []
    for scheme in _SCHEMES:
        result, dt = run_coupled(body, f"gfem.scheme={scheme}")
        reference, halved, heavier = _sensitivities(body, dt, len(result.tip))
        found, larger = errors(result, reference), np.maximum(halved, heavier)
        what = f"{scheme}: error {found[3]:.4f} at T over the larger sensitivity {larger[3]:.4f} is {found[3] / larger[3]:.2f}, at most 2"
        beside = f"at quarters {words(found)}; half step {words(halved)}, 0.1 % more load {words(heavier)}"
        checks.append(share(found[3] <= 2 * larger[3], f"{what} ({beside})", _SOURCE))
        checks += _crack_checks(scheme, body, result, reference, 0.1)
    return checks


@case
def gfem_fracture_long():
    """The plate breaks, T = 2.6, k = 4: error against the sensitivities of particles everywhere, broken bonds"""
    return _long_checks(Plate(5, 4, 2.6, _LOAD, _STRENGTH))


@case(slow=True)
def gfem_fracture_fine():
    """The plate breaks at H/h = 10, k = 8, T = 2.6: error against the sensitivities of particles everywhere, broken bonds"""
    return _long_checks(Plate(10, 8, 2.6, _LOAD, _STRENGTH))


@case(slow=True)
def gfem_fracture_loads():
    """The plate breaks under several loads, T = 2.6: mean square of the errors against that of the sensitivities, since a single run says little"""
    checks = []
    for ratio, k, loads in ((5, 4, (0.0015, 0.0016, 0.0017, 0.0018, 0.0019, 0.002)), (10, 8, (0.0015, 0.0017, 0.0018, 0.002))):
        for scheme in _SCHEMES:
            found, larger = [], []
            for load in loads:
                body = Plate(ratio, k, 2.6, load, _STRENGTH)
                result, dt = run_coupled(body, f"gfem.scheme={scheme}")
                reference, halved, heavier = _sensitivities(body, dt, len(result.tip))
                found.append(errors(result, reference)[3])
                larger.append(max(halved[3], heavier[3]))
            times = np.linalg.norm(found) / np.linalg.norm(larger)
            what = f"{scheme}, H/h = {ratio}, loads {', '.join(map(str, loads))}: errors at T {words(found)}, larger sensitivities {words(larger)}"
            checks.append(share(times <= 2, f"{what}; root mean squares {times:.2f} to 1, at most 2", _SOURCE))
    return checks


@case
def gfem_fracture_edges():
    """Cracks run into the layers that cannot fail and branch, T = 2.6: patches meet the surface and each other; the mean of four loads, 1 % apart"""
    bodies = [Plate(5, 4, 2.6, factor * _LOAD, _STRENGTH) for factor in (1.96, 1.98, 2.0, 2.02)]
    checks = []
    for scheme in _SCHEMES:
        broken, expected, error = [], [], []
        for body in bodies:
            result, dt = run_coupled(body, f"gfem.scheme={scheme}")
            reference = run_full(body, dt, len(result.tip))
            broken.append(result.broken)
            expected.append(reference.broken)
            error.append(errors(result, reference)[-1])
        what = f"{scheme}: broken bonds {broken}, of {expected} with particles everywhere: mean"
        checks.append(Check(what, np.mean(broken), np.mean(expected), 0.1, _SOURCE))
        checks.append(at_most(f"{scheme}: largest error of the displacement at T", max(error), 0.2, _SOURCE))
    return checks
