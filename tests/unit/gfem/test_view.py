"""What a coupled body looks like: particles everywhere, whoever moves them."""
import numpy as np
import pytest

from pdhpc.study.verify.case import plate, problem_of

CRACK = '[[crack]]\ntype = "polyline"\npoints = [[-13.0, 0.0], [-4.0, 0.0]]\n'
PULLED = '[[load]]\ntype = "force_density"\nregion = "all"\nvalue = [1e-3, -2e-3]\n'


def test_every_particle_is_where_its_owner_has_it(coupled_body, shake):
    stepper = coupled_body().stepper()
    view, local, solution = stepper.view, stepper.local, stepper.solution
    shake(stepper, 1e-2)
    view.prepare()
    particles = local.subdomain.particles
    kept = particles.velocity.copy()
    inside = local.inside[particles.slots]
    hats, cells = local.lattice.shape, solution.mesh.cells
    slots, cell, number = local.slots_of(np.arange(24))
    for name, nodal, own in (("displacement", solution.displacement, particles.position), ("velocity", solution.velocity, particles.velocity)):
        expected = np.zeros(particles.position.shape)
        expected[slots] = np.einsum("pa,pad->pd", hats[number], nodal[cells[cell]])
        expected = np.where(local.inside[:, None], own, expected)
        assert view.field(name) == pytest.approx(expected[particles.slots], abs=1e-15), name
        assert np.abs(view.field(name)[~inside]).max() > 1e-3 and 0 < inside.sum() < view.n
    assert np.array_equal(particles.velocity, kept), "looking leaves the particles alone"


def test_fields_are_those_of_particles_alone(coupled_body, shake):
    """Of the same displacements: energies, stress, strain and damage need what bonds reach, ghosts of no one."""
    stepper = shake(coupled_body(extra=PULLED).stepper(), 1e-2)
    view = stepper.view
    view.prepare()
    other = problem_of(plate((24, 16), extra=CRACK + PULLED))
    other.subdomain.particles.put(other.subdomain.particles.displacement, view.field("displacement"))
    plain = other.stepper().view
    assert np.array_equal(view.ids, plain.ids) and view.directed_bonds() == plain.directed_bonds() and view.broken() == plain.broken() == 0
    for name in ("displacement", "damage", "precrack", "force_density", "stress", "strain", "strain_energy_density"):
        expected = plain.field(name)
        assert view.field(name) == pytest.approx(expected, abs=1e-12 * np.abs(expected).max() + 1e-15), name


def test_what_is_not_finite_is_found(coupled_body):
    stepper = coupled_body().stepper()
    view, particles = stepper.view, stepper.local.subdomain.particles
    view.prepare()
    assert view.first_not_finite() is None
    slot = stepper.local.points.slots[7]
    particles.position[slot, 1] = np.nan
    row = int(np.flatnonzero(particles.slots == slot)[0])
    assert view.first_not_finite() == (int(particles.id[row]), tuple(view.places()[row]))
    particles.position[slot, 1] = 0.0
    vertex = np.flatnonzero((stepper.solution.mesh.points == (12.0, 8.0)).all(axis=1))[0]
    stepper.solution.displacement[vertex, 0] = np.inf
    view.prepare()
    assert np.all(np.abs(np.array(view.first_not_finite()[1]) - (12.0, 8.0)) <= 4.0), "a vertex shows in the particles of its cells"


def test_foremost_damage(coupled_body, lose_bonds):
    stepper = coupled_body().stepper()
    view, local = stepper.view, stepper.local
    x, members = view.places()[:, 0], np.arange(view.n)
    assert view.foremost(members, x, 0.2) == -1, "pre-cracks are no damage"
    inside = np.flatnonzero(local.inside[local.subdomain.particles.slots])
    for row in inside[[3, 40, 17]]:
        lose_bonds(local.subdomain, row)
    expected = max(inside[[3, 40, 17]], key=lambda row: x[row])
    found = view.foremost(members, x, 0.2)
    assert x[found] == x[expected] and found in inside and view.foremost(members[::-1], x[::-1], 0.2) == view.n - 1 - found


def test_active_particles_are_those_of_enriched_cells(coupled_body):
    stepper = coupled_body().stepper()
    active, local = stepper.view.field("active"), stepper.local
    assert set(active) == {0.0, 1.0} and active.sum() == local.n_active == len(local.points.slots)
    assert np.array_equal(active > 0, local.inside[local.subdomain.particles.slots])
