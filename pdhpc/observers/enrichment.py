"""What joins elements and particles, watched: columns of history.csv, and the guard that stops a run whose coupling fails."""
import numpy as np

from pdhpc.parallel.comm import exact_sum, largest
from pdhpc.run import Observer, RunError
from pdhpc.state import EVERYWHERE, Entry, number

_LARGEST_ENERGY = 1.1  # of what was there at the start and came in since


class Enrichment:
    """The ledger of a coupled run.

    active_share : of all particles those that move by themselves. enriched_x, enriched_y : degrees of freedom by component. energy_elements,
    energy_particles : kinetic and strain energy of the mesh outside the patches and of the particles in them. mass_iterations : of the solver so far.
    mass_condition : estimate for the scaled mass matrix. patches : vertices of J. projection_loss : kinetic energy that projections took so far.
    ghost_force : largest nodal force under uniform strain over sigma H.
    """

    def __init__(self, comm, stepper):
        """Collective."""
        self.comm, self.latest, self._refused, self._stepper = comm, {}, 0, stepper
        self._total = comm.allreduce(stepper.view.n)
        self.columns = ("active_share", "enriched_x", "enriched_y", "energy_elements [J]", "energy_particles [J]", "mass_iterations", "mass_condition",
                        "projection_loss [J]", "ghost_force", "patches")

    def read(self, stepper):
        """Return the values of the columns. Collective."""
        comm, local, solution = self.comm, stepper.local, stepper.solution
        ledger = stepper.ledger()
        stored = [exact_sum(comm, np.concatenate([solution.kinetic_energies(), solution.strain_energies()]))]
        stored.append(exact_sum(comm, np.concatenate([ledger["kinetic_energy"], ledger["strain_energy"]])) - stored[0])
        enriched = comm.allreduce(np.asarray(stepper.scheme.enriched[0], np.int64))
        self.latest = {
            "active_share": comm.allreduce(local.n_active) / self._total,
            "enriched_x": int(enriched[0]),
            "enriched_y": int(enriched[1]),
            "energy_elements": stored[0],
            "energy_particles": stored[1],
            "mass_iterations": int(largest(comm, stepper.scheme.mass.iterations)),
            "mass_condition": stepper.scheme.mass.condition(),
            "projection_loss": comm.allreduce(stepper.scheme.lost),
            "ghost_force": stepper.ghost_force(),
            "patches": int(comm.allreduce(int(stepper.patches.chosen[: solution.mesh.n_owned].sum()))),
        }
        self._refused = comm.allreduce(stepper.patches.refused)
        return list(self.latest.values())

    def state(self):
        """Return {key: Entry} of the solver's iterations so far."""
        return {"enrichment/iterations": Entry(lambda: largest(self.comm, self._stepper.scheme.mass.iterations), self._count_from, EVERYWHERE)}

    def _count_from(self, iterations):
        self._stepper.scheme.mass.iterations = int(iterations)

    def summary(self):
        """Return what run.json says."""
        return dict(self.latest)

    def warnings(self):
        """Return what the user should know."""
        if not self._refused:
            return []
        return [f"beside regions of prescribed motion {self._refused} vertices were wanted for patches and cannot have them: cells that touch such regions stay elements"]


class EnrichmentGuard(Observer):
    """Stops a run whose mass solver fails or whose energy grows: at the listed steps and every `every`."""

    def __init__(self, comm, steps, every=50):
        self.comm, self.steps, self.every = comm, steps, every
        self._initial, self._scale = None, 0.0

    def start(self, stepper):
        """Take the energy at the start. Collective."""
        self._initial = self._energies(stepper)[0]

    def state(self):
        """Return {key: Entry} of the energies so far."""
        return {"guard/initial": number(self, "_initial"), "guard/scale": number(self, "_scale")}

    def _energies(self, stepper):
        """Return (kinetic and strain energy, external work), J. Collective."""
        ledger = stepper.ledger()
        stored = exact_sum(self.comm, np.concatenate([ledger["kinetic_energy"], ledger["strain_energy"], ledger["dissipated_energy"]]))
        return stored, exact_sum(self.comm, ledger["external_work"])

    def observe(self, stepper):
        """Stop when a solver failed or the energy grew beyond what was put in. Collective."""
        failures = [each for each in self.comm.allgather(stepper.failure) if each is not None]
        if failures:
            raise RunError(f"by step {stepper.step}, t = {stepper.time:.6g} s, {failures[0]}")
        stored, work = self._energies(stepper)
        expected = self._initial + work
        self._scale = max(self._scale, abs(expected), self._initial)
        if not stored <= expected + (_LARGEST_ENERGY - 1.0) * self._scale and self._scale > 0.0:
            raise RunError(f"the energy is {stored:.4g} J at step {stepper.step}, t = {stepper.time:.6g} s, where {expected:.4g} J were put in: the coupling is"
                           " unstable here, or prescribed motion jumps; take time.dt = \"auto\" if it is a number, more particles in a cell, or gfem.everywhere")

    def finish(self, stepper):
        """Check the final state. Collective."""
        self.observe(stepper)
