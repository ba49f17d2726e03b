"""Impactors: where they are, how fast, and the force of the body on them, as columns of history.csv."""
from pdhpc.parallel.comm import exact_sum


class ImpactorGauge:
    """Position, velocity and force of one impactor."""

    def __init__(self, comm, name, dim):
        self.comm, self.name, self.dim = comm, name, dim
        words = (("position", "m"), ("velocity", "m/s"), ("force", "N"))
        self.columns = tuple(f"{name}.{word}_{axis} [{unit}]" for word, unit in words for axis in "xyz"[:dim])

    def read(self, stepper):
        """Return the values of the columns. Collective."""
        found = self.vectors(stepper)
        return [*found["position"], *found["velocity"], *found["force"]]

    def vectors(self, stepper):
        """Return {"name", "position", "velocity", "force"}, m, m/s and N; the force is minus the exact sum of those on particles. Collective."""
        impact = next(each for each in stepper.conditions.interactions if getattr(each, "impactor", None) is not None and each.impactor.name == self.name)
        force = [0.0 - exact_sum(self.comm, impact.forces()[:, axis]) for axis in range(self.dim)]
        return {"name": self.name, "position": impact.impactor.position.tolist(), "velocity": impact.impactor.velocity.tolist(), "force": force}
