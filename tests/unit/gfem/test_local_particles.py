"""Local particles: what is swept, what moves, and that where alpha is 1 they are plain peridynamics."""
import numpy as np
import pytest

from pdhpc.gfem.loads import sub_step_sums
from pdhpc.kernels.family import MIXED
from pdhpc.parallel.noise import noise
from pdhpc.study.verify.case import plate, problem_of

STEP = ("time.dt=1.2", "gfem.substeps=3", "time.end=12.0")
PULLED = '[[load]]\ntype = "force_density"\nregion = "all"\nvalue = [1e-3, -2e-3]\ntime = { function = "sine", frequency = 0.1, phase = 0.4 }\n'


def test_everywhere_it_is_plain_peridynamics(coupled_body):
    """Patches everywhere: three sub-steps of particles from a random state, breaking bonds, are three steps of a body of particles alone."""
    words = "critical_stretch = 0.02"
    local = coupled_body(STEP + ("gfem.everywhere=true",), material=words, extra=PULLED).stepper().local
    crack = '[[crack]]\ntype = "polyline"\npoints = [[-13.0, 0.0], [-4.0, 0.0]]\n'
    other = problem_of(plate((24, 16), extra=crack + PULLED, material=words), ["time.dt=0.4", "time.end=0.4"])
    for particles in (local.subdomain.particles, other.subdomain.particles):
        particles.put(particles.displacement, 0.02 * noise(particles.id, 2))
        particles.put(particles.velocity, 0.01 * noise(particles.id, 2, 1))
        particles.place()
    local.start(3, 0.4, 0.0)
    local.run()
    stepper = other.stepper()
    for _ in range(3):
        stepper.advance()
    mine, plain = local.subdomain.particles, other.subdomain.particles
    assert len(local.collar.slots) == len(local.blended.rows) == 0 and np.all(local.alpha[mine.slots] == 1.0)
    assert local.broken == stepper.broken > 0 and np.array_equal(local.subdomain.bonds.alive(), other.subdomain.bonds.alive())
    for one, two in ((mine.position, plain.position), (mine.velocity, plain.velocity), (mine.dissipated, plain.dissipated)):
        assert mine.owned(one) == pytest.approx(plain.owned(two), abs=1e-15)
    work = sum(load.work.sum() for load in other.parts[0].conditions.loads)
    assert local.particle_steps == 3 * 384 and local.external_work().sum() == pytest.approx(work, rel=1e-12)


def test_impulses_are_momenta_where_bonds_reach_alpha_one(coupled_body, shake):
    """I1 + S1 b = rho (V - v), I2 + S2 b = rho (U - u - dt v): the sums over a velocity Verlet run, lane by lane."""
    stepper = coupled_body(STEP, cells=(24, 32), extra=PULLED).stepper()
    low = stepper.solution.mesh.points[stepper.solution.mesh.cells[:, 0]]
    stepper.patches.add((low[:, 0] < 0.0) & (low[:, 1] >= -8.0) & (low[:, 1] < 8.0))
    stepper.follow()
    shake(stepper, 1e-2).seed_particles()
    local, blended = stepper.local, stepper.local.blended
    local.start(3, 0.4, 0.0)
    local.run()
    local.add_loads_to_sums()
    slots = (blended.rows[:, None] + np.arange(8)).ravel()
    i, j = bonds_by_slot(local.subdomain)
    least = local.alpha.copy()
    np.minimum.at(least, i, local.alpha[j])
    whole = (least[slots] == 1.0) & blended.inside
    assert 8 < whole.sum() < blended.inside.sum(), "rows on the ramp hold lanes inside it"
    held = blended.before, blended.velocity_before, blended.impulse, blended.moment
    before, velocity_before, first, second = (each.transpose(0, 2, 1).reshape(-1, 2) for each in held)
    particles = local.subdomain.particles
    gained = particles.velocity[slots] - velocity_before
    moved = particles.position[slots] - before - 1.2 * velocity_before
    assert first[whole] == pytest.approx(gained[whole], abs=1e-15) and second[whole] == pytest.approx(moved[whole], abs=1e-15)
    ramp = blended.inside & ~whole
    assert np.abs(first - gained)[ramp].max() > 1e-4, "on the ramp they are not"
    assert sub_step_sums(local.acting[0].time_function, 0.0, 0.4, 3)[0] > 0.0


def bonds_by_slot(subdomain):
    """Return (i, j), slots of the ends of each directed bond, broken ones too."""
    arrays, particles = subdomain.bonds.arrays, subdomain.particles
    i = np.repeat(particles.slots, len(arrays.offset))
    j = i + np.tile(arrays.offset, len(particles.slots))
    there = particles.block[j] != MIXED
    return i[there], j[there]


def test_blended_impulses_move_nothing_as_a_whole(coupled_body, shake):
    """Each bond pulls both of its ends alike, (alpha_p + alpha_q)/2: sums over all lanes, those outside enriched cells too, and rows of whole forces vanish."""
    stepper = shake(coupled_body(STEP).stepper(), 1e-2)
    local, blended = stepper.local, stepper.local.blended
    stepper.seed_particles()
    v = local.subdomain.particles.velocity.copy()
    local.start(3, 0.4, 0.0)
    local.run()
    rows = (local.rows[:, None] + np.arange(8)).ravel()
    total = blended.impulse.sum(axis=(0, 2)) + (local.subdomain.particles.velocity - v)[rows].sum(axis=0)
    assert np.abs(total).max() < 1e-14 and np.abs(blended.impulse).max() > 1e-4


def test_what_is_swept(coupled_body):
    """All that moves or feels a bond to where alpha is above 0 is swept once; alpha is 1 - (distance from J)/H across the ring of cells."""
    local = coupled_body().stepper().local
    places, particles = local.subdomain.places(), local.subdomain.particles
    assert np.array_equal(np.unique(local.points.slots // 8 * 8), local.moving)
    both = np.concatenate([local.rows, local.blended.rows])
    assert len(set(both.tolist())) == len(both)
    i, j = bonds_by_slot(local.subdomain)
    reached = (local.alpha > 0.0) | local.inside
    felt = reached.copy()
    felt[i[local.alpha[j] > 0.0]] = True
    assert set((np.flatnonzero(felt) // 8 * 8).tolist()) == set(both.tolist())
    collar = felt & ~local.inside
    assert np.array_equal(np.sort(local.collar.slots), np.flatnonzero(collar)) and collar.sum() > 0
    assert local.alpha[particles.slots] == pytest.approx(expected_alpha(places), abs=1e-12) and places[:, 0].max() > 4.0
    assert np.array_equal(local.inside[particles.slots], expected_alpha(places) > 0.0)


def expected_alpha(places):
    """1 where x < 0 and |y| < 4, falling over a cell of 4 to 0 (a product where both fall): J are the vertices of cells that the crack cuts."""
    x, y = places.T
    return np.clip(1.0 - x / 4.0, 0.0, 1.0) * np.clip(2.0 - np.abs(y) / 4.0, 0.0, 1.0)


def test_patches_may_grow_in_any_order(coupled_body):
    """Patches added to others leave what they would have been at once."""
    grown, at_once = coupled_body().stepper(), coupled_body().stepper()
    more = np.zeros((2, 24), bool)
    more[0, 9], more[1, [9, 17]] = True, True
    grown.patches.add(more[0])
    grown.follow()
    for stepper in (grown, at_once):
        stepper.patches.add(more[1])
        stepper.follow()
    one, two = grown.local, at_once.local
    for name in ("alpha", "inside", "rows", "moving"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name
    for name in ("rows", "cell", "shape", "alpha", "inside", "density"):
        assert np.array_equal(getattr(one.blended, name), getattr(two.blended, name)), name
    assert np.array_equal(one.collar.slots, two.collar.slots) and np.array_equal(one.points.slots, two.points.slots)
    assert np.array_equal(one.subdomain.particles.block, two.subdomain.particles.block)


def test_new_particles_take_the_state_of_the_mesh(coupled_body):
    stepper = coupled_body(tip=None).stepper()
    local, solution = stepper.local, stepper.solution
    assert len(local.points.slots) == len(local.rows) == len(local.collar.slots) == 0

    def field(x):
        return np.stack([x[:, 0] + 0.5 * x[:, 1], x[:, 0] * x[:, 1]], axis=1)

    solution.displacement[:], solution.velocity[:] = field(solution.mesh.points), -field(solution.mesh.points)
    stepper.patches.add(np.arange(24) == 9)
    stepper.follow()
    particles = local.subdomain.particles
    places = local.subdomain.places_at(local.points.slots)
    assert len(places) == 9 * 16
    assert particles.position[local.points.slots] == pytest.approx(field(places), abs=1e-11)
    assert particles.velocity[local.points.slots] == pytest.approx(-field(places), abs=1e-11)
    others = np.setdiff1d(particles.slots, local.points.slots)
    assert not particles.velocity[others].any(), "outside the patches particles have no state of their own"


def test_the_collar_follows_the_mesh(coupled_body):
    stepper = coupled_body(STEP).stepper()
    local, mesh = stepper.local, stepper.solution.mesh
    gradients = np.random.default_rng(3).uniform(-1e-3, 1e-3, (3, 2, 2))
    local.put_collar(mesh.points @ gradients[0])
    local.hold_collar(*(mesh.points @ gradient for gradient in gradients[1:]))
    places = local.subdomain.places_at(local.collar.slots)
    local.start(1, 0.8, 0.0)
    local.run()
    u, v, a = (places @ gradient for gradient in gradients)
    assert local.subdomain.particles.position[local.collar.slots] == pytest.approx(u + 0.8 * v + 0.32 * a, abs=1e-15)
    assert not local.subdomain.particles.velocity[local.collar.slots].any()


def test_a_collar_never_fails_and_others_may(coupled_body):
    """A stretch far beyond the critical one: bonds break where both ends are in enriched cells, nowhere else."""
    stepper = coupled_body(("time.dt=0.1", "time.end=1.0"), material="critical_stretch = 0.01").stepper()
    local, mesh = stepper.local, stepper.solution.mesh
    particles = local.subdomain.particles
    whole = local.subdomain.bonds.alive().copy()
    x = local.subdomain.places_at(local.points.slots)
    particles.position[local.points.slots] = 0.1 * x
    local.put_collar(0.1 * mesh.points)
    local.hold_collar(0.0 * mesh.points, 0.0 * mesh.points)
    local.start(1, 1e-6, 0.0)
    local.run()
    lost = whole - local.subdomain.bonds.alive()
    inside = local.inside[particles.slots]
    assert np.all(lost[~inside] == 0) and lost[inside].sum() == local.broken > 1000
    i, j = bonds_by_slot(local.subdomain)
    both = np.bincount(i, local.inside[i] & local.inside[j], len(local.inside))[particles.slots]
    assert np.all(local.subdomain.bonds.alive()[inside] <= (np.bincount(i, minlength=len(local.inside))[particles.slots] - both)[inside])


@pytest.mark.parametrize("scheme", ("pinned", "galerkin"))
def test_all_particles_of_watched_cells_are_seen(coupled_body, scheme):
    """Their rows are blended, though in "galerkin" alpha is 1 as far as bonds reach in most of them: 12 spacings a cell, families of 3.5. Whole ones are not."""
    grown, at_once = (coupled_body(["mesh.cell_size=12.0"], cells=(72, 48), tip=None, scheme=scheme).stepper() for _ in range(2))
    for stepper, cells, n_watched in ((grown, [5, 17], 16), (grown, [9], 14), (at_once, [5, 9, 17], 14)):  # cell 9 fills a gap: no cell is enriched by it
        stepper.patches.add(np.isin(np.arange(24), cells))
        stepper.follow()
        local = stepper.local
        watched = local.slots_of(np.flatnonzero(local.watched))[0]
        assert len(watched) == 144 * n_watched and np.all(np.isin(watched // 8 * 8, local.blended.rows))
        whole = local.slots_of(np.array([cells[0]], np.int32))[0]
        assert scheme == "pinned" or np.isin(whole // 8 * 8, local.rows).any()
    assert np.array_equal(grown.local.rows, at_once.local.rows) and np.array_equal(grown.local.blended.rows, at_once.local.blended.rows)


def test_cells_want_patches_when_their_particles_are_strained(coupled_body):
    stepper = coupled_body(tip=None, material="critical_stretch = 0.01").stepper()
    local, particles, lattice = stepper.local, stepper.local.subdomain.particles, stepper.local.lattice
    slots = lattice.slots_of(np.array([9], np.int32))[0]
    assert np.all(local.original_block(slots) == 0) and np.all(particles.block[slots] != 0), "they may not fail yet"
    stepper.patches.add(np.arange(24) == 9)
    stepper.follow()
    ring = np.flatnonzero(local.watched).tolist()
    assert ring == [4, 5, 6, 8, 10, 12, 13, 14] and np.all(particles.block[slots] == 0)
    inner = lattice.slots_of(np.array([10], np.int32))[0][5]

    def wanting(share):
        local.start(1, 1e-6, 0.0, share)
        return np.flatnonzero(local.wanting(share)).tolist()

    assert wanting(0.6) == []
    particles.position[inner, 0] += 0.007  # its neighbours along x are 1 apart
    assert wanting(0.8) == [] and wanting(0.6) == [10]
    local.run()
    assert not local.blended.seen.any()
    local.look(0.6)
    assert np.flatnonzero(local.wanting(0.6)).tolist() == [10]
    particles.position[inner, 0] -= 0.007
    for cell in (10, 9):
        local.subdomain.bonds.arrays.alive[0, lattice.slots_of(np.array([cell], np.int32))[0, 7]] = 0
    local.run()
    assert wanting(0.6) == [], "they broke before the last run, so the cell had its chance"
    particles.position[inner, 0] += 0.012
    local.start(1, 1e-6, 0.0)
    assert local.broken > 0 and np.flatnonzero(local.wanting(np.inf)).tolist() == [10], "bonds that broke are seen, and nobody looks at cell 9, which is whole"
