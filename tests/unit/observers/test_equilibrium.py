from types import SimpleNamespace

import numpy as np

from pdhpc.observers.equilibrium import EquilibriumGauge


def test_columns_of_the_last_load_step(comm):
    stepper = SimpleNamespace(residual=1e-7, iterations=30, ksp_iterations=200, equilibria=4, broken_in_step=12, damped=lambda: np.array([0.25, 0.5]),
                              totals={"rounding_residual": 0.0}, path=SimpleNamespace(tolerance=1e-6))
    gauge = EquilibriumGauge(comm)
    row = dict(zip(gauge.columns, gauge.read(stepper)))
    assert row == {"residual": 1e-7, "iterations": 30, "ksp_iterations": 200, "equilibria": 4, "broken_in_step": 12, "damped_energy [J]": 0.75}
    assert gauge.warnings() == []
    stepper.totals["rounding_residual"] = 3e-4
    gauge.read(stepper)
    assert gauge.warnings()[0].startswith("equilibria were found to a residual of 0.0003 alone, above static.tolerance = 1e-06: the rounding of positions")
