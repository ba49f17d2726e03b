"""The equilibria of load steps, watched: columns of history.csv."""
from pdhpc.parallel.comm import exact_sum


class EquilibriumGauge:
    """What the last load step came to.

    residual : forces out of balance over the largest applied or supporting force so far (peridynamics/equilibrium.py). iterations : of relaxation or of
    Newton, in all equilibria of the step; ksp_iterations : of the linear systems. equilibria : 1, and one more for each time bonds broke.
    broken_in_step : bonds. damped_energy : J, the part of the dissipated energy that no bond released.
    """

    columns = ("residual", "iterations", "ksp_iterations", "equilibria", "broken_in_step", "damped_energy [J]")

    def __init__(self, comm):
        self.comm, self.latest, self._left, self._tolerance = comm, {}, 0.0, 0.0

    def read(self, stepper):
        """Return the values of the columns. Collective."""
        self.latest = {name: getattr(stepper, name) for name in self.columns[:-1]}
        self._left, self._tolerance = stepper.totals["rounding_residual"], stepper.path.tolerance
        self.latest["damped_energy"] = exact_sum(self.comm, stepper.damped())
        return list(self.latest.values())

    def warnings(self):
        """Return what the user should know."""
        if self._left == 0.0:
            return []
        return [f"equilibria were found to a residual of {self._left:.3g} alone, above static.tolerance = {self._tolerance:g}: the rounding of positions allows no closer;"
                ' particles.kinematics = "linear" is not limited by it']
