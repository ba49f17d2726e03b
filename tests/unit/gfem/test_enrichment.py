"""The enriched space against dense matrices made function by function, point by point."""
import numpy as np
import pytest

from pdhpc.gfem.enrichment import EnrichedSpace


def hats(case):
    """Return (n, n_vertices), the standard functions at the points."""
    points, mesh = case.points, case.mesh
    values = np.zeros((len(points.mass), len(mesh.points)))
    corners = mesh.cells[np.repeat(points.cell, np.diff(points.start))]
    values[np.arange(len(values))[:, None], corners] = points.shape
    return values


def dense_functions(case, component, selected, centred=True):
    """Return (standard, enriched): (n, n_vertices) and (n, number selected), unit norm, of one component."""
    standard, mass, eta = hats(case), case.points.mass, case.eta[:, component]
    hat = standard[:, selected]
    mean = (mass * eta) @ hat / (mass @ hat) if centred else 0.0
    enriched = hat * (eta[:, None] - mean)
    return standard, enriched / np.sqrt(mass @ enriched**2)


def dense_mass(case, component, selected, centred=True):
    """Return the mass matrix over the vertices of enriched cells and the enriched functions, and (points, unknowns) the functions."""
    standard, enriched = dense_functions(case, component, selected, centred)
    vertices = np.flatnonzero(standard.any(axis=0))
    functions = np.hstack((standard[:, vertices], enriched))
    matrix = functions.T @ (case.points.mass[:, None] * functions)
    matrix[np.arange(len(vertices)), np.arange(len(vertices))] += case.lumped[vertices]
    return matrix, functions, vertices


def dense_residual(case, component):
    """Return (n_vertices,), what a least squares fit by the standard functions of each patch leaves, by the root of its mass and eta's root mean square."""
    standard, mass = hats(case), case.points.mass
    root = np.sqrt((mass @ case.eta**2).sum() / mass.sum())
    residual = np.zeros(len(case.mesh.points))
    cell_of = np.repeat(case.points.cell, np.diff(case.points.start))
    for vertex in np.flatnonzero(case.inside):
        at = (case.mesh.cells[cell_of] == vertex).any(axis=1)
        weight = np.sqrt(mass[at])
        fit, *_ = np.linalg.lstsq(weight[:, None] * standard[at], weight * case.eta[at, component], rcond=None)
        residual[vertex] = np.linalg.norm(weight * (case.eta[at, component] - standard[at] @ fit)) / np.sqrt(mass[at].sum()) / root
    return residual


def right_sides(case, momentum):
    """Return (n_vertices, dim), a right side of the standard functions: momentum, and something on the lumped mass."""
    other = np.stack([np.cos(case.mesh.points[:, 0]), np.sin(case.mesh.points[:, 1])], axis=1)
    return hats(case).T @ momentum + case.lumped[:, None] * other


@pytest.fixture
def case(comm, cracked_box):
    return cracked_box(comm)


def space_of(case, tolerance=0.02, **options):
    space = EnrichedSpace(case.mesh, **options)
    space.update(case.inside, case.points, case.lumped)
    space.select(case.eta, tolerance)
    return space


def test_residual_is_that_of_least_squares(case):
    space = space_of(case)
    for component in range(2):
        expected = dense_residual(case, component)
        assert space.residual[:, component] == pytest.approx(expected, abs=1e-9)
        assert np.array_equal(space.selected[:, component], expected > 0.02)
    assert 0 < space.enriched_functions[0] < space.enriched_functions[1] <= case.inside.sum(), "the crack opens along y, less along x"


def test_solution_is_the_dense_one(case):
    momentum = case.points.mass[:, None] * np.sin(3.0 * case.position + [0.0, 1.0])
    right = right_sides(case, momentum)
    space = space_of(case)
    solution = space.solve(right, momentum)
    assert space.failure is None and space.iterations > 3
    for component in range(2):
        matrix, functions, vertices = dense_mass(case, component, space.selected[:, component])
        enriched = functions[:, len(vertices) :].T @ momentum[:, component]
        x = np.linalg.solve(matrix, np.concatenate((right[vertices, component], enriched)))
        assert solution.nodes[vertices, component] == pytest.approx(x[: len(vertices)], abs=1e-10)
        assert solution.field[:, component] == pytest.approx(functions @ x, abs=1e-10)
        others = np.setdiff1d(np.arange(len(case.mesh.points)), vertices)
        assert solution.nodes[others, component] == pytest.approx(right[others, component] / case.lumped[others], rel=1e-14)


def test_condition_is_the_dense_one_and_centring_lowers_it(case):
    found = {}
    for centred in (True, False):
        shifted = vars(case) | {"eta": case.eta + [0.3, 3.0]}
        moved = type(case)(**shifted)
        space = space_of(moved, centred=centred)
        dense = []
        for component in range(2):
            matrix = dense_mass(moved, component, space.selected[:, component], centred)[0]
            scale = 1.0 / np.sqrt(np.diag(matrix))
            dense.append(np.linalg.eigvalsh(matrix * scale * scale[:, None]))
        values = np.concatenate(dense)
        found[centred] = space.condition()
        assert found[centred] == pytest.approx(values.max() / values.min(), rel=0.02)
    assert found[True] < 1e3 and found[False] > 10 * found[True]


def test_everything_enriched_reproduces_the_field(comm, cracked_box):
    """With points everywhere and tolerance 0 the field itself is in the space, and so is whatever functions of it say."""
    case = cracked_box(comm, inside=lambda x: np.ones(len(x), bool))
    space = space_of(case, 0.0)
    assert space.selected.all()
    mass = case.points.mass[:, None]
    solution = space.solve(hats(case).T @ (mass * case.eta), mass * case.eta)
    assert solution.field == pytest.approx(case.eta, abs=1e-11) and space.iterations <= 1
    nodal = np.cos(2.0 * case.mesh.points)
    mixed = hats(case) @ nodal + (hats(case) @ np.sin(case.mesh.points)) * case.eta
    assert space.solve(hats(case).T @ (mass * mixed), mass * mixed).field == pytest.approx(mixed, abs=1e-9) and space.iterations > 10


def test_projection_is_symmetric_and_idempotent(case):
    space, mass = space_of(case), case.points.mass[:, None]
    one, other = np.sin(3.0 * case.position), np.cos(2.0 * case.position + 1.0)
    # no mass but that of the points: the projection onto functions of the points alone
    space.update(case.inside, case.points, np.zeros_like(case.lumped))
    space.select(case.eta, 0.02)
    first, second = (space.solve(hats(case).T @ (mass * q), mass * q).field for q in (one, other))
    assert np.sum(mass * first * other) == pytest.approx(np.sum(mass * one * second), rel=1e-10)
    again = space.solve(hats(case).T @ (mass * first), mass * first)
    assert again.field == pytest.approx(first, abs=1e-10)
    lost = 0.5 * np.sum(mass * (one**2 - first**2))
    whole = type(space).lost_energy(space, mass * one, type(again)(None, None, first))
    assert 0.0 < whole < lost and lost == pytest.approx(0.5 * np.sum(mass * (one - first) ** 2), rel=1e-9)


def test_no_field_enriches_nothing(case):
    case.eta[...] = 0.0
    space = space_of(case, 0.0)
    assert not space.selected.any() and space.failure is None
    momentum = case.points.mass[:, None] * np.ones(2)
    assert np.isfinite(space.solve(right_sides(case, momentum), momentum).field).all()


def test_nearly_constant_field_keeps_its_digits(case):
    """1 + 1e-9 eta has the functions of eta: without the means of the cells their products would have lost all digits."""
    plain = space_of(case, 0.0)
    shape = plain.mass.values.copy()
    case.eta[...] = 1.0 + 1e-9 * case.eta
    assert space_of(case, 0.0).mass.values == pytest.approx(shape, abs=1e-5)
