"""Scenes of elements and particles: what is built, and what is refused."""
import numpy as np
import pytest

from pdhpc.scene.coupled import build_coupled
from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError

BOXES = {"right": ([11.5, -8.0], [12.5, 8.0]), "corner": ([7.5, -8.5], [12.5, -3.5]), "between": ([0.5, 0.5], [3.5, 3.5])}


def regions(*names):
    return "".join(f'[[region]]\nname = "{name}"\nshape = "box"\nlower = {BOXES[name][0]}\nupper = {BOXES[name][1]}\n' for name in names)


def hold(region, value='[0.0, "free"]'):
    return f'[[load]]\ntype = "displacement"\nregion = "{region}"\nvalue = {value}\n'


def test_parts_fit_each_other(coupled_body):
    problem = coupled_body()
    parts = problem.coupled_parts
    assert parts.mesh.n_global_cells == 24 and parts.part.subdomain.particles.n_owned == 384 and parts.lattice.ratio == 4
    assert problem.dt == 1.0 and problem.n_steps == 1 and problem.k == 2 and problem.critical_dt == parts.critical_dt
    stepper = problem.stepper()
    x, y = parts.mesh.points.T
    assert np.array_equal(stepper.patches.chosen, (x <= 0.0) & (np.abs(y) <= 4.0)), "cells with a particle that lost a bond to the crack, up to x = -4"


def test_steps_that_the_scene_leaves_open(coupled_body):
    """dt at most 0.75 of the mesh's critical step, sub-steps at most 0.57 of the particles'."""
    problem = coupled_body(("time.end=100.0",))
    particles = problem.coupled_parts.part.critical_dt
    assert 0.70 < problem.dt / problem.critical_dt <= 0.75 and problem.dt * problem.n_steps == pytest.approx(100.0)
    assert problem.dt / problem.k <= 0.57 * particles < problem.dt / (problem.k - 1)
    careful = coupled_body(("time.end=100.0", "time.safety=0.3"))
    assert careful.dt <= 0.3 * careful.critical_dt and careful.dt / careful.k <= 0.3 * particles


def test_everywhere(coupled_body):
    stepper = coupled_body(("gfem.everywhere=true",)).stepper()
    assert stepper.patches.chosen.all() and stepper.local.n_active == 384


@pytest.mark.parametrize("scheme", ("pinned", "galerkin"))
def test_schemes(coupled_body, scheme):
    assert coupled_body(scheme=scheme).stepper().scheme.name == scheme


def test_initial_motion_is_set_at_vertices_and_taken_by_particles(coupled_body):
    extra = '[[initial]]\ndisplacement = [0.5, 0.0]\nvelocity_gradient = [[0.0, 2.0], [1.0, 0.0]]\norigin = [1.0, 2.0]\n'
    problem = coupled_body(extra=extra)
    stepper = problem.stepper()
    local, solution = stepper.local, stepper.solution

    def speed(places):
        return np.stack([2.0 * (places[:, 1] - 2.0), places[:, 0] - 1.0], axis=1)

    standard, slots = ~stepper.patches.chosen, local.points.slots
    assert solution.velocity[standard] == pytest.approx(speed(solution.mesh.points[standard])) and np.all(solution.displacement[standard] == (0.5, 0.0))
    particles = local.subdomain.particles
    assert particles.velocity[slots] == pytest.approx(speed(local.subdomain.places_at(slots)))
    assert particles.position[slots] == pytest.approx(np.broadcast_to((0.5, 0.0), (len(slots), 2)))


def test_a_coupled_body_that_spins(coupled_body):
    problem = coupled_body(extra="[[initial]]\nangular_velocity = [2.0]\norigin = [1.0, 2.0]\n")
    stepper = problem.stepper()
    standard, solution = ~stepper.patches.chosen, stepper.solution
    places = solution.mesh.points[standard]
    assert solution.velocity[standard] == pytest.approx(np.stack([-2.0 * (places[:, 1] - 2.0), 2.0 * (places[:, 0] - 1.0)], axis=1))


def test_holes_have_no_cells(coupled_body_text, comm):
    text = coupled_body_text().replace("[time]", '[[body.hole]]\nshape = "box"\nlower = [4.0, -8.0]\nupper = [8.0, -4.0]\n[time]', 1)
    parts = build_coupled(parse_scene(text, "scene"), comm).coupled_parts
    assert parts.mesh.n_global_cells == 23 and parts.part.subdomain.particles.n_owned == 368
    assert parts.solution.outside_mass.sum() == pytest.approx(368.0)


def test_continuum_moduli(coupled_body):
    """Plane stress, E = 1, nu = 1/3: C11 = 9/8."""
    parts = coupled_body(("fem.moduli=continuum",)).coupled_parts
    assert parts.material.moduli[:, :, 0, 0] == pytest.approx(np.full(parts.material.moduli.shape[:2], 9 / 8))


def test_what_it_says_of_itself(coupled_body, comm):
    problem = coupled_body()
    stepper = problem.stepper()
    sizes = problem.sizes(stepper, comm)
    assert sizes["cells"] == 24 and sizes["vertices"] == 35 and sizes["particles"] == 384
    stepper.advance()
    work = problem.work(stepper, comm, 2.0)
    assert work["particle_steps"] == 2 * stepper.local.n_active and work["particle_steps_per_second_and_core"] == stepper.local.n_active
    assert work["bond_evaluations"] == stepper.bond_evaluations["body"] and work["particle_imbalance"] == 1.0 and work["bytes_sent_per_step"] == 0
    assert problem.work(stepper, comm, 0.0)["particle_steps_per_second_and_core"] is None
    coupled = problem.coupled(stepper, comm, problem.coupling(stepper, comm))
    assert coupled["scheme"] == "pinned" and coupled["sub_steps"] == 2 and coupled["particle_dt"] == 0.5
    assert coupled["step_over_critical"] == 1.0 / problem.critical_dt
    assert len(problem.guards(stepper, comm, [])) == 1


@pytest.mark.parametrize("overrides, options, words", [
    (("time.dt=3.3", "time.end=33.0"), {}, r"time.dt = 3\.3.*0\.8"),
    (("time.dt=2.4", "time.end=24.0", "gfem.substeps=1"), {}, r'gfem\.substeps = 1, sub-steps of 2\.4 s; allowed is "auto" or at least 2: the particles\''),
    ((), {"extra": regions("between") + hold("between")}, r'load\[0\]: region = "between", which holds no vertex of the mesh; allowed is a region'),
    ((), {"extra": regions("right", "corner") + hold("right") + hold("corner")}, r'load\[1\]: region = "corner", where another load prescribes the same'),
    ((), {"extra": '[[crack]]\nname = "c"\ntype = "polyline"\npoints = [[0.31, 0.22], [0.3100001, 0.22]]\n'}, "crack 'c' = a crack that cuts no bond"),
    ((), {"extra": '[[initial]]\nregion = "between"\nvelocity = [1.0, 0.0]\n' + regions("between")}, r'initial\[0\]: region = "between", which holds no'),
], ids=("step", "sub-steps", "no vertex", "twice", "no bond", "initial"))
def test_what_is_refused(coupled_body, overrides, options, words):
    with pytest.raises(SceneError, match=words):
        coupled_body(overrides, **options)


def test_what_may_be_unstable_if_the_scene_says_so(coupled_body):
    problem = coupled_body(("time.dt=2.4", "time.end=24.0", "gfem.substeps=1", "time.allow_unstable=true"))
    assert problem.k == 1 and problem.dt == 2.4


def test_two_holds_of_different_components_may_meet(coupled_body):
    solution = coupled_body(extra=regions("right", "corner") + hold("right") + hold("corner", '["free", 0.0]')).coupled_parts.solution
    x, y = solution.mesh.points.T
    held = np.zeros((len(x), 2), bool)
    for motion in solution.motions:
        held[np.ix_(motion.indices, motion.components)] = True
    assert np.array_equal(held[:, 0], x == 12.0) and np.array_equal(held[:, 1], (x >= 8.0) & (y <= -4.0))


@pytest.mark.parametrize("tip, fits", ((2.0, True), (3.0, False)))
def test_cracks_near_held_regions_are_refused(coupled_body, tip, fits):
    """x = 12 is held, so that vertices from x = 8 on never join: particles may lose bonds up to x = 4, and do so half a bond, 1.7, beyond the tip."""
    problem = coupled_body(("gfem.everywhere=true",), tip=tip, extra=regions("right") + hold("right"))
    if fits:
        assert problem.stepper().patches.chosen.any()
        return
    with pytest.raises(SceneError, match=r"crack = pre-cracks that cut bonds in 2 cells, one around \(6, -2\) m, within two cells of where motion is prescribed"):
        problem.stepper()


def test_a_reaction_is_the_force_of_the_supports(coupled_body, comm):
    """R = - sum of the elements' forces at the held vertices, K d of assembled stiffnesses; regions without held vertices count the particles' forces."""
    extra = regions("right", "between") + hold("right") + "".join(
        f'[[probe]]\nname = "{name}"\nregion = "{name}"\nquantity = "reaction"\n' for name in ("right", "between")
    ) + "[[initial]]\ndisplacement_gradient = [[1e-3, 2e-3], [0.0, -1e-3]]\n"
    problem = coupled_body(tip=None, extra=extra)
    stepper, parts = problem.stepper(), problem.coupled_parts
    from pdhpc.scene.gauges import make_gauges

    probes = make_gauges(problem, stepper.view, comm)[1]
    mesh, u = parts.mesh, parts.solution.displacement
    force = np.zeros_like(u)
    for cell, corners in enumerate(mesh.cells):
        force[corners] += (parts.material.whole_stiffness[parts.material.kind[cell]] @ u[corners].ravel()).reshape(4, 2)
    stepper.view.prepare()
    found = probes[0].read(stepper)
    assert found == pytest.approx(force[mesh.points[:, 0] == 12.0].sum(axis=0).tolist(), rel=1e-12) and found[0] > 0.005
    assert probes[0].supports is not None and probes[1].supports is None and max(map(abs, probes[1].read(stepper))) < 1e-15, "uniform strain inside the body"
