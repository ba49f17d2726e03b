import numpy as np
import pytest

from pdhpc.gfem.display import displayed


def after_three_steps(pulled_plate, comm, scheme):
    parts, stepper = pulled_plate(comm, scheme)
    for _ in range(3):
        stepper.advance()
    return parts, stepper, *displayed(comm, stepper)


def test_what_is_shown_is_the_space_of_the_displacement(pulled_plate, comm):
    parts, stepper, data, attributes = after_three_steps(pulled_plate, comm, "galerkin")
    assert attributes == {"step": 3, "time": 9.0, "scheme": "galerkin", "spacing": 1.0, "pixel": 0.125, "tolerance": 0.02}
    enriched, residual = data["vertices/enriched"], data["vertices/residual"]
    assert np.array_equal(enriched > 0, residual > 0.02) and 0 < enriched.sum() < 2 * data["vertices/patch"].sum()
    vertex, component = data["functions/vertex"], data["functions/component"]
    assert len(vertex) == 3 and set(component) == {0, 1} and sorted(component) == component.tolist()
    for name in (0, 1):  # ids are places on one rank
        assert residual[vertex[component == name][0], name] == residual[:, name].max()
    place = parts.mesh.points[vertex[-1]]
    hat = np.prod(np.maximum(0.0, 1.0 - np.abs(data["raster/position"] - place) / 5.0), axis=1)
    assert data["raster/functions"][:, -1] == pytest.approx(hat * data["raster/displacement"][:, component[-1]], abs=1e-6 * np.abs(data["raster/displacement"]).max())


def test_looking_changes_nothing(pulled_plate, comm):
    """The next step of a run that was looked at is that of one that was not."""
    found = []
    for looks in (False, True):
        _, stepper = pulled_plate(comm, "galerkin")
        for _ in range(4):
            stepper.advance()
            if looks:
                displayed(comm, stepper)
        stepper.view.prepare()
        found.append((stepper.view.field("displacement"), stepper.scheme.mass.iterations))
    assert np.array_equal(found[0][0], found[1][0]) and found[0][1] == found[1][1]


def test_pattern_is_symmetric_and_of_selected_unknowns(pulled_plate, comm):
    _, _, data, _ = after_three_steps(pulled_plate, comm, "galerkin")
    number, row, column = (data[name] for name in ("unknowns/number", "entries/row", "entries/column"))
    assert data["unknowns/enriched"].sum() == data["vertices/enriched"].sum() and set(row) == set(number)
    assert set(zip(row, column)) == set(zip(column, row))
    component = dict(zip(number, data["unknowns/component"]))
    assert all(component[i] == component[j] for i, j in zip(row, column))


def test_pinned_shows_its_patches_and_its_field(pulled_plate, comm):
    parts, stepper, data, attributes = after_three_steps(pulled_plate, comm, "pinned")
    assert {name.split("/")[0] for name in data} == {"vertices", "cells", "raster"} and "tolerance" not in attributes
    patch, cells = data["vertices/patch"], data["cells/vertex"]
    assert np.array_equal(data["vertices/enriched"], np.repeat(patch[:, None], 2, axis=1)) and patch.sum() > 0
    in_patches = patch[cells].sum(axis=1)
    assert np.array_equal(data["cells/patch"], np.where(in_patches == 4, 2, np.minimum(in_patches, 1))) and set(data["cells/patch"]) == {0, 1, 2}
    assert len(data["raster/position"]) == 64 * 25 * (data["cells/patch"] > 0).sum()
