"""The enriched space on several ranks gives what it gives on one; ranks without an enriched cell take part."""
import numpy as np
import pytest

from pdhpc.gfem.display import displayed
from pdhpc.gfem.enrichment import EnrichedSpace

NEAR_LEFT_END = lambda x: (np.abs(x[:, 1] - 1.6) < 1.0) & (x[:, 0] < 1.5)  # noqa: E731


def run(case, tolerance):
    """Return {name: {global id: value}} of what the space selects and solves."""
    mesh, points = case.mesh, case.points
    space = EnrichedSpace(mesh)
    space.update(case.inside, points, case.lumped)
    space.select(case.eta, tolerance)
    momentum = points.mass[:, None] * np.sin(3.0 * case.position + [0.0, 1.0])
    right = np.zeros((len(mesh.points), 2))
    corners = mesh.cells[np.repeat(points.cell, np.diff(points.start))]
    np.add.at(right, corners, points.shape[:, :, None] * momentum[:, None])
    bound = mesh.exchange.bind(right)
    bound.accumulate()
    bound.free()
    solution = space.solve(right + case.lumped[:, None] * np.cos(mesh.points), momentum)
    assert space.failure is None
    at_points = zip(map(tuple, np.round(case.position, 9)), solution.field)
    at_vertices = {name: dict(zip(mesh.vertex_id.tolist(), values)) for name, values in (("nodes", solution.nodes), ("selected", space.selected))}
    owned = {name: dict(zip(mesh.vertex_id[: mesh.n_owned].tolist(), values)) for name, values in (("mean", space.mean), ("residual", space.residual))}
    return {"field": dict(at_points), **at_vertices, **owned}, space.condition(), space.enriched_functions


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("where", [None, NEAR_LEFT_END], ids=["across ranks", "on some ranks"])
def test_same_on_any_number_of_ranks(comm, cracked_box, where):
    from mpi4py import MPI

    counts = (9, 4)
    case = cracked_box(comm, counts, inside=where)
    found, condition, functions = run(case, 0.02)
    alone, condition_alone, functions_alone = run(cracked_box(MPI.COMM_SELF, counts, inside=where), 0.02)
    for name, values in found.items():
        tolerance = {"mean": 0.0, "selected": 0.0, "residual": 1e-12}.get(name, 1e-10)
        for key, value in values.items():
            assert np.abs(np.subtract(value, alone[name][key], dtype=float)).max() <= tolerance, (name, key)
    assert condition == pytest.approx(condition_alone, rel=0.05)
    assert comm.allreduce(functions).tolist() == functions_alone.tolist() and functions_alone.min() > 0
    without = comm.allreduce(int(len(case.points.cell) == 0))
    assert without > 0 if where is NEAR_LEFT_END else comm.allreduce(len(found["field"])) == len(alone["field"])


@pytest.mark.mpi(min_size=2)
def test_nothing_enriched_anywhere(comm, cracked_box):
    case = cracked_box(comm, inside=lambda x: np.zeros(len(x), bool))
    found, condition, functions = run(case, 0.02)
    assert condition == 1.0 and functions.sum() == 0
    assert all(np.abs(value - np.cos(case.mesh.points[row])).max() < 1e-14 for row, value in enumerate(found["nodes"].values()))


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("scheme", ["galerkin", "instant", "literal"])
def test_coupled_run_is_the_same_on_any_number_of_ranks(comm, pulled_plate, scheme):
    """The crack grows across the ranks' border. Particles by id, vertices by id, to 1e-9 of the largest displacement; the same bonds break."""
    from mpi4py import MPI

    steps = (3.0, 4) if scheme == "galerkin" else (0.5, 1)
    found = []
    for ranks in (comm, MPI.COMM_SELF):
        parts, stepper = pulled_plate(ranks, scheme, steps=steps)
        for _ in range(12 if scheme == "galerkin" else 20):
            stepper.advance()
        assert stepper.failure is None
        particles, n = parts.local.subdomain.particles, parts.mesh.n_owned
        inside = parts.local.inside[particles.slots]
        u = particles.owned(particles.position)
        at_particles = {int(i): value for i, value in zip(particles.id[: particles.n_owned][inside], u[inside])}
        at_vertices = dict(zip(parts.mesh.vertex_id[:n].tolist(), parts.solution.displacement[:n]))
        found_by = stepper.scheme
        numbers = [ranks.allreduce(stepper.broken), *ranks.allreduce(found_by.enriched[0]), ranks.allreduce(found_by.lost)]
        numbers.append(getattr(found_by, "critical_dt", 0.0))
        found.append((at_particles, at_vertices, numbers))
    (particles, vertices, numbers), (all_particles, all_vertices, expected) = found
    scale = max(np.abs(value).max() for value in all_vertices.values())
    assert all(np.abs(value - all_particles[key]).max() < 1e-9 * scale for key, value in particles.items())
    assert all(np.abs(value - all_vertices[key]).max() < 1e-9 * scale for key, value in vertices.items())
    assert numbers[:3] == expected[:3] and numbers[3:] == pytest.approx(expected[3:], rel=1e-6, abs=1e-12)
    assert comm.allreduce(len(particles)) == len(all_particles)


@pytest.mark.mpi(min_size=2)
def test_display_holds_the_same_rows(comm, pulled_plate):
    """What is written for the picture, joined over ranks: the same vertices, functions and number of entries as on one rank."""
    from mpi4py import MPI

    found = []
    for ranks in (comm, MPI.COMM_SELF):
        _, stepper = pulled_plate(ranks, "galerkin")
        for _ in range(3):
            stepper.advance()
        parts = ranks.allgather(displayed(ranks, stepper)[0])
        found.append({name: np.concatenate([part[name] for part in parts]) for name in parts[0]})
    joined, alone = found
    order, expected = (np.argsort(each["vertices/id"]) for each in found)
    assert np.array_equal(joined["vertices/enriched"][order], alone["vertices/enriched"][expected])
    assert joined["functions/vertex"].tolist() == alone["functions/vertex"].tolist()
    order, expected = (np.lexsort(each["raster/position"].T) for each in found)
    assert joined["raster/displacement"][order] == pytest.approx(alone["raster/displacement"][expected], abs=1e-6 * np.abs(alone["raster/displacement"]).max())
    assert {name: values.shape for name, values in joined.items()} == {name: values.shape for name, values in alone.items()}
