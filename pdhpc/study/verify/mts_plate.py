"""The multi-time-step method on a pre-cracked plate in tension, against one small step everywhere and against other ways to couple regions."""
from typing import NamedTuple

import numpy as np

from pdhpc.parallel.comm import exact_sum, world
from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import Check, at_most, case, plate
from pdhpc.study.verify.mts import coupled, field_by_id, true_step

_STEPS = 1600  # of the fine region: a multiple of every step ratio
_SHARE = 0.085  # of the critical step: the fine step
_LOAD = """
[[crack]]
type = "polyline"
points = [[-41.0, 0.0], [0.0, 0.0]]
[[region]]
name = "top"
shape = "box"
lower = [-40.0, 37.0]
upper = [40.0, 40.0]
[[region]]
name = "bottom"
shape = "box"
lower = [-40.0, -40.0]
upper = [40.0, -37.0]
[[load]]
type = "traction"
region = "top"
face = "+y"
value = [0.0, 3e-3]
time = TIME
[[load]]
type = "traction"
region = "bottom"
face = "-y"
value = [0.0, -3e-3]
time = TIME
"""
_RAMP = np.linspace(0.0, 1.0, 61)
_RAMP = f'{{ function = "table", times = {[60.0 * t for t in _RAMP.tolist()]}, values = {(10 * _RAMP**3 - 15 * _RAMP**4 + 6 * _RAMP**5).tolist()} }}'
_LOAD = _LOAD.replace("TIME", _RAMP)
_NOTCH = '[[crack]]\ntype = "polyline"\npoints = [[-13.0, 0.0], [0.0, 0.0]]\n'
_BOX = '[fine]\nshape = "box"\nlower = [-7.0, -10.0]\nupper = [41.0, 10.0]\n'
_DISK = '[fine]\nshape = "disk"\ncenter = [2.5, 0.0]\nradius = 9.0\n'


class Result(NamedTuple):
    """u (n, 2), m; damage (n,); broken bonds; bond evaluations; energy balance error over the external work; bonds that one copy broke alone at the end."""

    u: np.ndarray
    damage: np.ndarray
    broken: int
    cost: int
    balance: float
    mismatched: int


def run(m, method="mts", fine=_BOX, interface="", breaks=True, single_step=1):
    """Return the Result of the plate at the end of 1600 fine steps; single_step: of method "single", in fine steps. Collective over all ranks."""
    comm = world()
    words = _LOAD if method == "single" else fine + f"step_ratio = {m}\n" + (f'interface = "{interface}"\n' if interface else "") + _LOAD
    text = plate((80, 80), 3.015, kinematics="finite", extra=words, material="critical_stretch = 0.03" if breaks else "")
    dt = _SHARE * _critical() * (single_step if method == "single" else m)
    settings = ["particles.volume_correction=none", f"time.dt={dt!r}", f"time.end={dt * (_STEPS // (single_step if method == 'single' else m))!r}", f"time.method={method}", "time.allow_unstable=true"]
    problem = build(parse_scene(text, "verification scene", settings), comm)
    stepper = problem.stepper()
    while stepper.step < problem.n_steps:
        stepper.advance()
    stepper.view.prepare()
    u, damage = (field_by_id(stepper.view, stepper.view.field(name), comm) for name in ("displacement", "damage"))
    energies = {name: exact_sum(comm, values) for name, values in stepper.ledger().items()}
    work = energies.pop("external_work")
    common = getattr(stepper, "common_bonds", None)
    mismatched = common.unify() if common is not None else 0
    cost = comm.allreduce(sum(stepper.bond_evaluations.values()))
    return Result(u, damage, comm.allreduce(stepper.broken) // 2, cost, (sum(energies.values()) - work) / work, comm.allreduce(mismatched))


_known = {}


def _critical():
    """Return the critical step of the plate without its crack, s."""
    if "dt" not in _known:
        problem = build(parse_scene(plate((24, 24), 3.015), "verification scene", ["particles.volume_correction=none"]), world())
        _known["dt"] = true_step(problem.parts[0], problem.body.law)
    return _known["dt"]


def apart(result, reference):
    """Return the relative L2 difference of displacements."""
    return float(np.linalg.norm(result.u - reference.u) / np.linalg.norm(reference.u))


def wrong(result, reference):
    """Return the number of particles whose damage differs."""
    return int((result.damage != reference.damage).sum())


@case
def mts_plate_elastic():
    """Without growth: errors against one small step everywhere, and error and cost against sub-cycling"""
    reference, source = run(1, "single", breaks=False), "Lindsay, Parks & Prakash 2016, table 2"
    found = {m: run(m, breaks=False) for m in (1, 2, 4, 10)}
    error = {m: apart(result, reference) for m, result in found.items()}
    coarse = apart(run(1, "single", breaks=False, single_step=10), reference)
    words = ", ".join(f"{m}: {value:.2e}" for m, value in error.items())
    checks = [at_most("m = 1: the undivided run", error[1], 1e-11, "identity")]
    checks.append(Check(f"errors by m {words}, and {coarse:.2e} at one step of 10 dt, rise in this order", float(error[2] < error[4] < error[10] < coarse), 1.0, 0.0, source))
    checks.append(Check(f"error at m = 10 over that at 2 is {error[10] / error[2]:.1f}, within [20, 45]: second order", float(20 <= error[10] / error[2] <= 45), 1.0, 0.0, source))
    for m in (4, 10):
        plain = run(m, "subcycling", breaks=False)
        for name, result, most in (("polynomial", found[m], 0.3), ("kick", run(m, interface="kick", breaks=False), 4.0)):
            ratio, cost = apart(result, reference) / apart(plain, reference), result.cost / plain.cost
            what = f"m = {m}, {name}: {ratio:.2f} times sub-cycling's error, at most {most} (cost {cost:.2f} times, for an overlap that is 40 % of so small a region)"
            checks.append(Check(what, float(ratio <= most), 1.0, 0.0, "prototype"))
    return checks


@case
def mts_cost():
    """Bond evaluations of a macro step against sub-cycling's, a fifth of 90,000 particles in the fine region"""
    checks, comm = [], world()
    for m in (4, 10):
        found = {}
        for name, dearest in (("subcycling", 1.0), ("polynomial", 1.25), ("kick", 1.16)):
            fine = f'[fine]\nshape = "box"\nlower = [-30.0, -50.0]\nupper = [150.0, 50.0]\nstep_ratio = {m}\n'
            method = ["time.method=subcycling"] if name == "subcycling" else [f"fine.interface={name}"]
            problem = build(parse_scene(plate((300, 300), 3.015, kinematics="finite", extra=fine), "verification scene", ["time.dt=0.8", "time.end=2.0", *method]), comm)
            stepper = problem.stepper()
            before = comm.allreduce(sum(stepper.bond_evaluations.values()))
            stepper.advance()
            found[name] = comm.allreduce(sum(stepper.bond_evaluations.values())) - before
            if name != "subcycling":
                ratio = found[name] / found["subcycling"]
                checks.append(Check(f"m = {m}, {name}: {ratio:.3f} times sub-cycling's, at most {dearest}", float(ratio <= dearest), 1.0, 0.0, "prototype"))
    return checks


@case
def mts_plate_crack():
    """A crack inside the fine region, and one that leaves it: the same bonds break for m up to 4, no flag is left different in two copies"""
    reference = run(1, "single")
    checks = [Check("bonds break", float(reference.broken > 100), 1.0, 0.0, "a case that tests something")]
    for m in (1, 2, 4, 10):
        result = run(m)
        if m <= 4:
            checks.append(Check(f"m = {m}: particles of other damage (error of u {apart(result, reference):.1e})", wrong(result, reference), 0, 0.0, "same broken bonds"))
        else:
            checks.append(at_most(f"m = {m}: energy balance against that of one small step (error of u {apart(result, reference):.1e})", result.balance - reference.balance, 2e-3, "energy"))
    for m in (4, 10):
        result, coarse = run(m, fine=_DISK), run(1, "single", single_step=m)
        checks.append(Check(f"crack through the overlap, m = {m}: flags that differ", result.mismatched, 0, 0.0, "bonds broken in either copy"))
        words = f"crack through the overlap, m = {m}: error {apart(result, reference):.1e} below that of one step {m} dt, {apart(coarse, reference):.1e}"
        checks.append(Check(words, float(apart(result, reference) < apart(coarse, reference)), 1.0, 0.0, "prototype"))
    return checks


@case
def mts_order():
    """Second order in time, error against a run of a sixteenth of the step"""
    comm, found = world(), {}
    extra = '[[initial]]\nregion = "all"\nvelocity_gradient = [[1e-3, 5e-4], [0.0, -1e-3]]\n'
    span = None
    for halving in (0, 1, 2, 3, 5):
        problem = coupled(4, "exact", (40, 24), 6.0, 0.45, extra=extra)
        span = problem.dt * 60 if span is None else span
        problem.dt = span / (60 * 2**halving)
        stepper = problem.stepper()
        for _ in range(60 * 2**halving):
            stepper.advance()
        found[halving] = field_by_id(stepper.view, stepper.view.field("displacement"), comm)
    errors = [np.linalg.norm(found[halving] - found[5]) for halving in (0, 1, 2, 3)]
    orders = [float(np.log2(a / b)) for a, b in zip(errors[:-1], errors[1:])]
    return [Check(f"observed order, halving {number + 1}", order, 2.0, 0.1, "central differences", relative=False) for number, order in enumerate(orders)]


def _set_in_motion(problem, amplitude):
    """Give a plate of 24 by 24 spacings smooth velocities of the given size in bending and in tension."""
    for part in problem.parts:
        particles, places = part.subdomain.particles, part.subdomain.places()
        x, y = (places[:, 0] + 12) / 24, places[:, 1]
        across = np.cos(np.pi * x) * np.cos(2 * np.pi * (y + 12) / 24)
        particles.put(particles.velocity, amplitude * np.stack([across, np.sign(y) * np.sin(np.pi * np.abs(y) / 12)], axis=1))


@case
def mts_finite():
    """Large motions: mean energy of long runs against the undivided run"""
    comm, checks = world(), []
    for share, amplitude, count, interfaces in ((0.85, 0.02, 4000, ("exact",)), (0.65, 0.10, 12_000, ("polynomial", "kick"))):
        means = {}
        for interface in (*interfaces, "single"):
            problem = coupled(4, "kick" if interface == "single" else interface, (24, 24), 5.0, share, "finite", _NOTCH)
            if interface == "single":
                dt = problem.dt
                problem = build(parse_scene(plate((24, 24), kinematics="finite", extra=_NOTCH), "verification scene", [f"time.dt={dt!r}", f"time.end={1e5 * dt!r}", "time.allow_unstable=true"]), comm)
            _set_in_motion(problem, amplitude)
            stepper, sums = problem.stepper(), []
            for _ in range(count):
                stepper.advance()
                if stepper.step % 100 == 0 and stepper.step > count // 2:
                    stepper.view.prepare()
                    ledger = stepper.ledger()
                    sums.append(comm.allreduce(float(ledger["kinetic_energy"].sum() + ledger["strain_energy"].sum())))
            means[interface] = float(np.mean(sums))
        for interface in interfaces:
            what = f"{interface}: mean energy of {count} macro steps at {share} of the critical step, v0/c = {amplitude}, over the undivided run's"
            checks.append(Check(what, means[interface] / means["single"], 1.0, 0.02, "prototype"))
    return checks
