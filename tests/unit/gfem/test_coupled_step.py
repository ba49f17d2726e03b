"""The coupled step: its order, its patches, its energies, and that its state is all that a run needs."""
import numpy as np
import pytest

from pdhpc.peridynamics.fields import strain_energy_density
from pdhpc.study.verify.case import plate, problem_of

STEP = ("time.dt=1.2", "gfem.substeps=3", "time.end=60.0")
BRITTLE = "critical_stretch = 0.02"
PULLED = """
[[region]]
name = "top"
shape = "box"
lower = [-12.0, 4.0]
upper = [12.0, 8.0]
[[load]]
type = "traction"
region = "top"
face = "+y"
value = [0.0, 0.01]
time = { function = "sine", frequency = 0.02 }
"""
HELD = """
[[region]]
name = "right"
shape = "box"
lower = [11.5, -8.0]
upper = [12.5, 8.0]
[[load]]
type = "displacement"
region = "right"
value = ["free", 0.01]
time = { function = "ramp", start = 0.0, end = 20.0 }
"""


def test_a_step_is_five_verbs(coupled_body):
    stepper, called = coupled_body(STEP).stepper(), []
    for verb in ("choose_patches", "seed_particles", "run_particles", "reconstruct", "solve"):
        whole = getattr(stepper, verb)
        setattr(stepper, verb, lambda *arguments, verb=verb, whole=whole: (called.append(verb), whole(*arguments))[1])
    stepper.advance()
    assert called == ["choose_patches", "seed_particles", "run_particles", "reconstruct", "solve"]
    assert stepper.step == 1 and stepper.time == 1.2
    assert set(stepper.seconds) == {"force", "exchange", "wait", "integrate", "choose", "seed", "reconstruct", "solve"}
    assert stepper.local.particle_steps == 3 * len(stepper.local.points.slots) and stepper.bytes_sent == 0 and stepper.failure is None
    rows, family = len(stepper.local.rows) + len(stepper.local.blended.rows), len(stepper.local.subdomain.bonds.arrays.offset)
    assert stepper.bond_evaluations == {"body": 4 * 8 * rows * family}, "at both ends of three sub-steps, eight particles in a row"


@pytest.mark.parametrize("scheme", ("pinned", "galerkin"))
def test_a_continued_run_needs_no_more_than_the_state(coupled_body, shake, scheme):
    """Six steps, or three, what `state` says put into another body, and three more: the same bits, bonds broken in both halves, patches grown."""
    options = dict(material=BRITTLE, extra=PULLED + HELD, scheme=scheme)
    through, half, other = (coupled_body(STEP, **options).stepper() for _ in range(3))
    for stepper in (through, half):
        shake(stepper, 0.04)
    counts = [through.patches.chosen.sum()]
    for number in range(6):
        through.advance()
        if number == 2:
            counts.append(through.patches.chosen.sum())
    for _ in range(3):
        half.advance()
    stored = {key: np.copy(get()) for key, (get, *_) in half.state().items()}
    for key, (_, put, *_) in other.state().items():
        put(stored[key])
    other.resume()
    broken = half.broken
    assert other.broken == broken
    for _ in range(3):
        other.advance()
    assert through.patches.chosen.sum() >= counts[1] > counts[0] and through.broken == other.broken > broken > 0
    for key, (get, *_) in other.state().items():
        expected = through.state()[key][0]()
        assert np.array_equal(get(), expected) or key == "work/particle_loads" and get() == pytest.approx(expected, rel=1e-14), key  # a sum taken up at another place
    for name, values in through.ledger().items():
        assert other.ledger()[name].sum() == pytest.approx(values.sum(), rel=1e-12), name


def test_the_collar_is_told_where_the_mesh_goes(coupled_body):
    """The acceleration in the middle of the step to come: a_n + (a_n - a_{n-1})/2."""
    stepper = coupled_body(STEP).stepper()
    solution, collar = stepper.solution, stepper.local.collar
    solution.displacement[:], solution.velocity[:] = (1.0, 2.0), (3.0, 4.0)
    solution.acceleration[:], solution.previous_acceleration[:] = (5.0, 6.0), (7.0, 10.0)
    stepper.choose_patches()
    stepper.seed_particles()
    for found, expected in ((collar.displacement, (1.0, 2.0)), (collar.velocity, (3.0, 4.0)), (collar.acceleration, (4.0, 4.0))):
        assert len(found) > 0 and found == pytest.approx(np.broadcast_to(expected, found.shape))


def test_cells_without_particles_join_when_their_strain_says_so(coupled_body):
    """Uniform strain e along x: above theta s0 all cells that may fail join, below none; the activation is 0.6 unless the scene says otherwise."""
    for strain, joins in ((0.0119, False), (0.0121, True)):
        stepper = coupled_body(STEP, tip=None, material=BRITTLE).stepper()
        stepper.solution.displacement[:, 0] = strain * stepper.solution.mesh.points[:, 0]
        stepper.choose_patches()
        assert stepper.patches.chosen.all() == joins == stepper.patches.chosen.any()
    stepper = coupled_body(STEP + ("gfem.activation=0.5",), tip=None, material=BRITTLE).stepper()
    stepper.solution.displacement[:, 0] = 0.0101 * stepper.solution.mesh.points[:, 0]
    stepper.choose_patches()
    assert stepper.patches.chosen.all()


def test_cells_that_may_not_fail_stay_elements(coupled_body):
    extra = '[[region]]\nname = "safe"\nshape = "box"\nlower = [-12.0, -8.0]\nupper = [0.0, 8.0]\n[damage]\nno_fail = ["safe"]\n'
    stepper = coupled_body(STEP, tip=None, material=BRITTLE, extra=extra).stepper()
    mesh = stepper.solution.mesh
    stepper.solution.displacement[:, 0] = 0.1 * mesh.points[:, 0]
    stepper.choose_patches()
    assert np.array_equal(stepper.patches.chosen, mesh.points[:, 0] >= 0.0)


def test_vertices_of_prescribed_motion_never_join(coupled_body):
    stepper = coupled_body(STEP, tip=None, material=BRITTLE, extra=HELD).stepper()
    mesh = stepper.solution.mesh
    stepper.solution.displacement[:, 0] = 0.1 * mesh.points[:, 0]
    stepper.choose_patches()
    assert np.array_equal(stepper.patches.chosen, mesh.points[:, 0] < 8.0)
    assert stepper.patches.refused == 10, "both columns of vertices of the cells that are held"


def test_patches_follow_a_crack(coupled_body):
    """Particles on the ramp whose bonds break bring the patches of their cells."""
    stepper = coupled_body(STEP, material=BRITTLE).stepper()
    before, local = stepper.patches.chosen.copy(), stepper.local
    ring = np.flatnonzero(stepper.patches.enriched & ~stepper.patches.whole)
    local.subdomain.bonds.arrays.alive[0, local.lattice.slots_of(ring[:1].astype(np.int32))[0, 5]] = 0
    local.blended.seen[:] = True  # as after a run that broke them
    stepper.choose_patches()
    added = stepper.patches.chosen & ~before
    assert added.any() and np.all(np.isin(np.flatnonzero(added), stepper.solution.mesh.cells[ring[0]]))
    assert np.all(local.inside[local.points.slots]) and len(local.points.slots) == 16 * stepper.patches.enriched.sum(), "everything has followed"


def test_energies_are_those_of_the_particles_alone_under_uniform_strain(coupled_body):
    """In elements by the moduli of the lattice, on the ramp by both: their shares add up, but for bonds across the ramp's kinks and those that are cut."""
    gradient = np.array([[1e-3, 2e-4], [-4e-4, 5e-4]])
    stepper = coupled_body(STEP, cells=(40, 40)).stepper()
    solution, local = stepper.solution, stepper.local
    other = problem_of(plate((40, 40)))
    particles = other.subdomain.particles
    particles.put(particles.displacement, other.subdomain.places() @ gradient.T)
    particles.put(particles.velocity, np.broadcast_to([3.0, -4.0], (1600, 2)))
    other.stepper()
    expected = strain_energy_density(other.subdomain, other.body.law).sum()
    solution.displacement[:] = solution.mesh.points @ gradient.T
    solution.velocity[:] = (3.0, -4.0)
    slots = local.points.slots
    local.subdomain.particles.position[slots] = local.subdomain.places_at(slots) @ gradient.T
    local.subdomain.particles.velocity[slots] = (3.0, -4.0)
    stepper.view.prepare()
    cut = (local.subdomain.bonds.family_size - local.subdomain.bonds.initial_size).sum() / local.subdomain.bonds.family_size.sum()
    ledger = stepper.ledger()
    assert ledger["kinetic_energy"].sum() == pytest.approx(0.5 * 1600 * 25.0)
    assert ledger["strain_energy"].sum() == pytest.approx(expected, rel=3 * cut) and 0.0 < cut < 0.02
    assert ledger["strain_energy"].sum() < expected
    assert ledger["dissipated_energy"].sum() == ledger["external_work"].sum() == 0.0


def balance(stepper, steps):
    """Return the largest difference of kinetic and strain energy from what was there and came in over some steps, over the largest work; J/J."""
    before = {name: values.sum() for name, values in stepper.ledger().items()}
    assert before["external_work"] == 0.0 < before["kinetic_energy"], "what is held moves from the start"
    off, work = [], []
    for _ in range(steps):
        stepper.advance()
        ledger = {name: values.sum() for name, values in stepper.ledger().items()}
        work.append(ledger["external_work"])
        off.append(ledger["kinetic_energy"] + ledger["strain_energy"] - before["kinetic_energy"] - work[-1])
    return np.abs(off).max() / np.abs(work).max()


def test_energy_of_elements_is_what_was_put_in(coupled_body):
    """Pulled and held, without patches: central differences keep the balance to second order in the step."""
    off = []
    for dt, steps in ((0.8, 50), (0.4, 100)):
        stepper = coupled_body((f"time.dt={dt}", "gfem.substeps=1", "time.end=60.0"), tip=None, extra=PULLED + HELD).stepper()
        off.append(balance(stepper, steps))
    assert off[0] < 3e-3 and 3.0 < off[0] / off[1] < 5.5


def test_energy_with_patches_is_nearly_what_was_put_in(coupled_body):
    """The blend damps, and keeps no energy: at 0.6 of the critical step and 17 steps it is off by some percent."""
    stepper = coupled_body(("time.dt=2.4", "time.end=60.0"), extra=PULLED + HELD).stepper()
    assert balance(stepper, 17) < 0.05


@pytest.mark.parametrize("where, stops", (("right", True), ("middle", False), ("no_fail", False)))
def test_material_that_fails_beside_held_regions_stops_the_run(coupled_body, where, stops):
    """Elements strained beyond the limit, at x = 10 beside the vertices that are held at 12, where they may not be enriched; in the middle they may, and
    those that never fail never do."""
    extra = HELD + ('[damage]\nno_fail = ["right"]\n'.replace('"right"', '"near"') + '[[region]]\nname = "near"\nshape = "box"\nlower = [4.0, -8.0]\nupper = [12.0, 8.0]\n'
                    if where == "no_fail" else "")
    stepper = coupled_body(STEP, tip=None, material=BRITTLE, extra=extra).stepper()
    x = stepper.solution.mesh.points[:, 0]
    stepper.solution.displacement[:, 0] = 0.03 * np.clip(x + 4.0, 0.0, 4.0) if where == "middle" else 0.03 * np.maximum(x - 8.0, 0.0)
    assert stepper.failure is None
    stepper.choose_patches()
    assert (stepper.failure is not None) == stops and stepper.patches.chosen.any() == (where == "middle")
    if stops:
        assert stepper.failure.startswith("the material failed near (10, -6) m at t = 0 s, within two cells of where motion is prescribed")


def test_bonds_that_break_on_a_ramp_for_good_stop_the_run(coupled_body):
    """Cell 17, x from 4 to 8, has vertices at x = 8 that never join J, so that elements share the bonds of its particles."""
    stepper = coupled_body(STEP, tip=None, material=BRITTLE, extra=HELD).stepper()
    local = stepper.local
    stepper.patches.add(np.isin(np.arange(24), (13, 14)))
    stepper.follow()
    assert local.watched[17] and stepper.patches.never_whole()[17] and not stepper.patches.never_whole()[13]
    local.subdomain.bonds.arrays.alive[0, local.lattice.slots_of(np.array([17], np.int32))[0, 7]] = 0
    local.blended.seen[:] = True  # as after a run that broke them
    stepper.choose_patches()
    assert stepper.failure.startswith("the material failed near (6, -2) m")
