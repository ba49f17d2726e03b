import numpy as np
import pytest


def test_without_enrichment_it_is_central_differences_on_the_mesh(pulled_plate, comm):
    """No function enriched: the trajectory of the mesh alone, consistent mass in the patches. Its critical step then is that of elements, above 2."""
    parts, stepper = pulled_plate(comm, "literal", tolerance=1e9, steps=(1.0, 1))
    scheme, solution, mesh = stepper.scheme, parts.solution, parts.mesh
    before = solution.displacement.copy()
    for _ in range(12):
        now = solution.displacement.copy()
        stepper.advance()
        if stepper.step == 11:
            kept = now, solution.displacement.copy(), before
        before = now
    (last, u, _), final = kept, solution.displacement
    stiffness = np.zeros_like(u)
    for cell, kind in zip(mesh.cells, parts.material.kind):  # 16 ramps of each kind, the first without particles
        stiffness[cell] += (parts.material.stiffness[16 * kind] @ u[cell].ravel()).reshape(-1, 2)
    load = np.zeros_like(u)
    for each in parts.local.loads:
        np.add.at(load, mesh.cells[each.cells], each.nodal * each.time_function.value(11.0))
    mass = np.diag(solution.outside_mass)
    for cell in np.flatnonzero(parts.patches.enriched):
        mass[np.ix_(mesh.cells[cell], mesh.cells[cell])] += parts.material.consistent[parts.material.kind[cell]]
    assert final == pytest.approx(2 * u - last + np.linalg.solve(mass, load - stiffness), abs=1e-10 * np.abs(final).max())
    assert scheme.critical_dt > 2.0 and scheme.enriched[0].sum() == 0


def test_far_off_where_the_galerkin_scheme_is_not(pulled_plate, comm):
    """Stress from broken gradients: at a step of a quarter of the particles' critical one it is bounded, and wrong."""
    found = {}
    for name in ("galerkin", "literal"):
        parts, stepper = pulled_plate(comm, name, steps=(0.4, 1))
        parts.local.law.break_at[...] = np.inf
        for _ in range(150):
            stepper.advance()
        found[name] = parts.solution.displacement
    difference = np.linalg.norm(found["literal"] - found["galerkin"]) / np.linalg.norm(found["galerkin"])
    assert 0.1 < difference < 10.0
