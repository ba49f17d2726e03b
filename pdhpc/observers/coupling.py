"""What couples two regions, watched: columns of history.csv, and the guard that stops a run whose coupling fails."""
import numpy as np

from pdhpc.parallel.comm import exact_sum, largest
from pdhpc.run import Observer, RunError
from pdhpc.state import EVERYWHERE, Entry, number

_LARGEST_GAP = 0.1  # of the largest relative displacement of two bonded particles of the overlap
_NOTICEABLE = 1e-3  # of the largest displacement: what runs ahead of a wave front is no failure
_LARGEST_ENERGY = 1.05  # of what was there at the start and came in since
_ADVICE = "take a smaller time.dt (time.safety = 0.65 is safe for finite deformations), or a larger fine region"


class Coupling:
    """The ledger of the coupling of two regions.

    conserved_quantity : with multipliers E* = sum_s 1/2 a'(M_s - dt_s^2/4 K_s) a + 1/2 v' K_s v, J/s^2, which linear kinematics keeps between breaks under constant
    loads; with kicks sum_s kinetic + strain - external work - dt_s^2/8 a' M_s a, J. NaN in finite kinematics with multipliers.
    """

    def __init__(self, comm, stepper):
        self.comm, self.latest, self.first, self._stepper = comm, {}, None, stepper
        unit = "J/s^2" if stepper.operator.keeps_multipliers else "J"
        self.columns = (f"conserved_quantity [{unit}]", "multiplier_work [J]", "velocity_gap [m/s]", "displacement_gap [m]", "interface_iterations",
                        "bond_evaluations_coarse", "bond_evaluations_fine", "bond_evaluations_interface", "load_imbalance", "broken_in_overlap")

    def read(self, stepper):
        """Return the values of the columns. Collective."""
        comm, interface = self.comm, stepper.interface
        gap = interface.velocity_gap()
        if not stepper.operator.keeps_multipliers:
            gap = 0.0 * gap  # a kick leaves the copies at one velocity: their mean
        evaluations = {name: int(comm.allreduce(count)) for name, count in stepper.bond_evaluations.items()}
        seconds = stepper.seconds["force"]
        self.latest = {
            "conserved_quantity": exact_sum(comm, stepper.conserved_quantity()),
            "multiplier_work": exact_sum(comm, np.array([interface.work])),
            "velocity_gap": float(largest(comm, np.abs(gap).max(initial=0.0))),
            "displacement_gap": float(largest(comm, np.abs(interface.displacement_gap()).max(initial=0.0))),
            "interface_iterations": int(largest(comm, stepper.iterations)),
            **{f"bond_evaluations_{name}": count for name, count in evaluations.items()},
            "load_imbalance": largest(comm, seconds) / max(comm.allreduce(seconds) / comm.size, 1e-12),
            "broken_in_overlap": int(comm.allreduce(stepper.broken_in_overlap())) // 2,
        }
        if self.first is None:
            self.first = self.latest["conserved_quantity"]
        return list(self.latest.values())

    def state(self):
        """Return {key: Entry} of the conserved quantity at the start, and of the iterations so far."""
        iterations = Entry(lambda: largest(self.comm, self._stepper.iterations), lambda count: setattr(self._stepper, "iterations", int(count)), EVERYWHERE)
        return {"coupling/first": number(self, "first"), "coupling/iterations": iterations}

    def relative_change(self):
        """Return the change of the conserved quantity since the start, over its first value; None where there is none."""
        if not self.latest or not np.isfinite(self.first) or self.first == 0.0:
            return None
        return self.latest["conserved_quantity"] / self.first - 1.0

    def warnings(self):
        """Return what the user should know."""
        broken = self.latest.get("broken_in_overlap", 0)
        return [f"damage reached the overlap of the regions ({broken} bonds broke there): enlarge the fine region, so that cracks stay inside"] if broken else []


class CouplingGuard(Observer):
    """Stops a run whose interface solver fails, whose copies drift apart or whose energy grows: at the listed steps and every `every`."""

    def __init__(self, comm, steps, every=100):
        self.comm, self.steps, self.every = comm, steps, every
        self._initial, self._scale = None, 0.0

    def start(self, stepper):
        """Take the energy at the start. Collective."""
        self._initial = self._energies(stepper)[0]

    def state(self):
        """Return {key: Entry} of the energies so far."""
        return {"guard/initial": number(self, "_initial"), "guard/scale": number(self, "_scale")}

    def _energies(self, stepper):
        """Return (kinetic and strain energy, without what only comes and goes with the step; external work), J. Collective."""
        ledger = stepper.ledger()
        stored = np.concatenate([ledger["kinetic_energy"], ledger["strain_energy"], stepper.shadow()])
        return exact_sum(self.comm, stored), exact_sum(self.comm, ledger["external_work"])

    def observe(self, stepper):
        """Stop when the displacement gap or the energy shows that the coupling fails. Collective."""
        failures = [each for each in self.comm.allgather(stepper.operator.failure) if each is not None]
        if failures:
            raise RunError(f"by step {stepper.step}, t = {stepper.time:.6g} s, {failures[0]}")
        stepper.view.prepare()
        stored, work = self._energies(stepper)
        expected = self._initial + work
        self._scale = max(self._scale, abs(expected), self._initial)
        if not stored <= expected + (_LARGEST_ENERGY - 1.0) * self._scale and self._scale > 0.0:
            raise RunError(f"the energy of the coupled regions is {stored:.4g} J at step {stepper.step}, t = {stepper.time:.6g} s, where {expected:.4g} J were put in: {_advice(stepper)}")
        gap, scale = stepper.largest_gap()
        gap, scale = largest(self.comm, gap), largest(self.comm, scale)
        most = largest(self.comm, max(float(np.abs(subdomain.particles.displacement).max(initial=0.0)) for subdomain in stepper.parts))
        if gap > _LARGEST_GAP * scale and gap > _NOTICEABLE * most:
            raise RunError(f"the two copies of the overlap are {gap:.3g} m apart at step {stepper.step}, t = {stepper.time:.6g} s, {gap / scale:.0%} of the largest relative"
                           f" displacement of bonded particles there: {_advice(stepper)}")

    def finish(self, stepper):
        """Check the final state. Collective."""
        self.observe(stepper)


def _advice(stepper):
    return _ADVICE if stepper.operator.name == "kick" else f'{_ADVICE}, or fine.interface = "kick"'
