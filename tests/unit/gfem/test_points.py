"""Particles in cells: against the places that the lattice itself has."""
import numpy as np
import pytest

from pdhpc.gfem.points import interpolate

HOLE = '[[body.hole]]\nshape = "box"\nlower = [0.0, -4.0]\nupper = [4.0, 0.0]\n'


@pytest.fixture(scope="module")
def parts(request):
    """Parts of a plate of 6 x 4 cells, one of them a hole."""
    from pdhpc.study.verify.case import problem_of

    text = request.getfixturevalue("plain_text").replace("[time]", HOLE + "[time]")
    return problem_of(text).coupled_parts


@pytest.fixture(scope="module")
def plain_text():
    from pdhpc.study.verify.case import plate

    return 'model = "gfem"\n' + plate((24, 16), extra="[mesh]\ncell_size = 4.0\n")


def test_every_particle_lies_in_its_cell_at_its_place(parts):
    lattice, mesh, subdomain = parts.lattice, parts.mesh, parts.part.subdomain
    assert lattice.ratio == 4 and len(mesh.cells) == 23, "6 x 4 cells without the hole"
    slots = lattice.slots_of(np.arange(23, dtype=np.int32))
    assert sorted(slots.ravel()) == sorted(subdomain.particles.slots), "each particle once"
    places = subdomain.places_at(slots.ravel()).reshape(23, 16, 2)
    assert places == pytest.approx(mesh.points[mesh.cells[:, 0]][:, None] + lattice.template + 0.5, abs=1e-12)
    assert np.einsum("pa,cad->cpd", lattice.shape, mesh.points[mesh.cells]) == pytest.approx(places, abs=1e-12), "the functions are those of the cells' corners"


def test_functions_sum_to_one_and_gradients_to_nothing(parts):
    lattice = parts.lattice
    assert lattice.shape.sum(axis=1) == pytest.approx(np.ones(16)) and lattice.gradient.sum(axis=1) == pytest.approx(np.zeros((16, 2)), abs=1e-14)
    corners = parts.mesh.points[parts.mesh.cells[5]]
    assert np.einsum("pad,ae->pde", lattice.gradient, corners) == pytest.approx(np.broadcast_to(np.eye(2), (16, 2, 2)), abs=1e-13), "grad x = 1"
    at_corners = np.isin(lattice.template, (0, 3)).all(axis=1)
    assert np.array_equal(lattice.corner_gradient, lattice.gradient[at_corners]) and at_corners.sum() == 4


def test_cells_whose_particles_are_elsewhere_have_none(parts):
    """A lattice of 6 x 4 cells seen through a mesh that has the hole's cell too: nobody is there."""
    lattice = parts.lattice
    kept = lattice.mesh
    corner = np.array([[0.0, -4.0], [4.0, -4.0], [4.0, 0.0], [0.0, 0.0], [100.0, 100.0], [-104.0, 0.0]])
    lattice.mesh = type("Mesh", (), {"points": corner, "cells": np.array([[0, 1, 2, 3], [4, 4, 4, 4], [5, 5, 5, 5]])})
    try:
        assert len(lattice.listed(np.arange(3))[0]) == 0
        assert np.all(lattice.slots_of(np.arange(3, dtype=np.int32)) == -1), "in the hole, and beyond the grid of the lattice on both sides"
    finally:
        lattice.mesh = kept


def test_particles_are_listed_cell_by_cell(parts):
    slots, cell, number = parts.lattice.listed([7, 2])
    assert np.array_equal(slots, parts.lattice.slots_of(np.array([7, 2], np.int32)).ravel())
    assert np.array_equal(cell, np.repeat([7, 2], 16)) and np.array_equal(number, np.tile(np.arange(16), 2))
    assert all(len(each) == 0 for each in parts.lattice.listed([]))


def test_points_of_some_cells(parts):
    lattice, particles = parts.lattice, parts.part.subdomain.particles
    points = lattice.points_of([7, 2], np.array([3.0, 3.0]))
    assert points.start.tolist() == [0, 16, 32] and points.cell.tolist() == [7, 2]
    assert np.array_equal(points.slots, lattice.slots_of(np.array([7, 2], np.int32)).ravel())
    assert np.array_equal(points.shape, np.tile(lattice.shape, (2, 1))) and np.all(points.mass == 3.0) and particles.volume.max() == 1.0
    empty = lattice.points_of(np.empty(0, np.int32), np.array([3.0]))
    assert empty.start.tolist() == [0] and empty.shape.shape == (0, 4)


def test_interpolation_is_exact_for_bilinear_fields(parts):
    lattice, mesh, subdomain = parts.lattice, parts.mesh, parts.part.subdomain
    slots, cell, number = lattice.listed(np.arange(23))

    def field(x):
        return np.stack([1.0 + 2.0 * x[:, 0] - x[:, 1], x[:, 0] * x[:, 1], np.full(len(x), 3.0)], axis=1)

    result = np.empty((len(slots), 3))
    interpolate(mesh.cells, cell, number, lattice.shape, field(mesh.points), result)
    assert result == pytest.approx(field(subdomain.places_at(slots)), abs=1e-11)
