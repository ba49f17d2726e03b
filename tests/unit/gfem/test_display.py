import numpy as np
import pytest

from pdhpc.gfem.display import displayed


def test_what_is_shown_is_the_space_of_displacements(pulled_plate, comm):
    parts, stepper = pulled_plate(comm, "galerkin")
    for _ in range(3):
        stepper.advance()
    data = displayed(comm, stepper)
    enriched, residual = data["vertices/enriched"], data["vertices/residual"]
    assert enriched.sum(axis=0).tolist() == stepper.scheme.enriched[0].tolist() and np.array_equal(enriched > 0, residual > 0.02)
    assert data["points/eta"] == pytest.approx(stepper.scheme.state.increment)
    vertex, component = data["functions/vertex"], data["functions/component"]
    assert component.tolist() == [0, 0, 1, 1][: len(component)] and residual[vertex[-2], 1] == residual[:, 1].max()  # ids are places on one rank
    place = parts.mesh.points[vertex[-1]]
    hat = np.prod(np.maximum(0.0, 1.0 - np.abs(data["points/position"] - place) / 5.0), axis=1)
    assert data["points/functions"][:, -1] == pytest.approx(hat * data["points/eta"][:, component[-1]], abs=1e-15)


def test_pattern_is_symmetric_and_of_selected_unknowns(pulled_plate, comm):
    _, stepper = pulled_plate(comm, "galerkin")
    for _ in range(3):
        stepper.advance()
    data = displayed(comm, stepper)
    number, row, column = (data[name] for name in ("unknowns/number", "entries/row", "entries/column"))
    assert data["unknowns/enriched"].sum() == stepper.scheme.enriched[0].sum() and set(row) == set(number)
    assert set(zip(row, column)) == set(zip(column, row))
    component = dict(zip(number, data["unknowns/component"]))
    assert all(component[i] == component[j] for i, j in zip(row, column))


def test_pinned_shows_its_vertices(pulled_plate, comm):
    _, stepper = pulled_plate(comm, "pinned")
    data = displayed(comm, stepper)
    assert all(name.startswith("vertices/") for name in data)
    assert np.array_equal(data["vertices/enriched"], np.repeat(data["vertices/patch"][:, None], 2, axis=1)) and data["vertices/patch"].sum() > 0
