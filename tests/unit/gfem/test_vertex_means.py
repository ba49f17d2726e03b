"""Means of particles around vertices: linear fields are their own, at inner vertices, edges and corners of a body."""
import numpy as np
import pytest

from pdhpc.gfem.vertex_means import VertexMeans
from pdhpc.study.verify.case import plate, problem_of

HOLE = '[[body.hole]]\nshape = "box"\nlower = [0.0, -4.0]\nupper = [4.0, 0.0]\n'


@pytest.fixture(scope="module")
def parts():
    return problem_of('model = "gfem"\n' + plate((24, 16), extra="[mesh]\ncell_size = 4.0\n").replace("[time]", HOLE + "[time]")).coupled_parts


def linear(x):
    return np.stack([0.3 + 2.0 * x[:, 0] - 0.7 * x[:, 1], 1.0 - x[:, 0] + 0.1 * x[:, 1]], axis=1)


def reentrant(x):
    """Vertices of the hole, three of whose four particles are there."""
    return np.isin(x[:, 0], (0.0, 4.0)) & np.isin(x[:, 1], (-4.0, 0.0))


def test_linear_fields_are_exact(parts):
    mesh, subdomain = parts.mesh, parts.part.subdomain
    vertices = np.flatnonzero(~reentrant(mesh.points))
    assert len(vertices) == 7 * 5 - 4
    means = VertexMeans(parts.lattice, subdomain, vertices)
    field, nodal = np.full(subdomain.particles.position.shape, np.nan), np.full(mesh.points.shape, -9.0)
    slots = subdomain.particles.slots
    field[slots] = linear(subdomain.places_at(slots))
    field[~np.isin(np.arange(len(field)), slots)] = 1e9  # nobody reads what is no particle
    means.store(field, nodal)
    assert nodal[vertices] == pytest.approx(linear(mesh.points[vertices]), abs=1e-12)
    assert np.all(nodal[reentrant(mesh.points)] == -9.0), "others are left alone"


def test_inside_it_is_the_plain_mean_and_at_a_corner_of_a_hole_that_of_three(parts):
    mesh, subdomain = parts.mesh, parts.part.subdomain
    places = subdomain.places()
    for at in ((-4.0, 4.0), (4.0, 0.0)):
        vertex = np.flatnonzero((mesh.points == at).all(axis=1))
        around = np.abs(places - at).max(axis=1) < 1.0
        assert around.sum() == (4 if at[0] < 0 else 3)
        field, nodal = np.zeros((len(subdomain.particles.position), 2)), np.zeros(mesh.points.shape)
        values = np.sin(places) + places**2
        field[subdomain.particles.slots] = values
        VertexMeans(parts.lattice, subdomain, vertex).store(field, nodal)
        assert nodal[vertex[0]] == pytest.approx(values[around].mean(axis=0))
