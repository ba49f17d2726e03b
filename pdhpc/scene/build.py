"""Scene -> objects: what one rank needs to run it, in one or two regions of particles, on a mesh, or on both."""
from pdhpc.geometry import cracks
from pdhpc.peridynamics.bonds import cut_by_cracks
from pdhpc.peridynamics.velocity_verlet import VelocityVerlet
from pdhpc.scene.body import make_body
from pdhpc.scene.amounts import amounts_of
from pdhpc.scene.clearance import check_clear
from pdhpc.scene.conditions import make_conditions, select_particles, set_initial_state
from pdhpc.scene.interactions import make_interactions, stiffer_step
from pdhpc.scene.parts import make_part, partition_of
from pdhpc.scene.problem import Problem
from pdhpc.scene.regions import make_regions
from pdhpc.scene.remarks import overlaps, remarks_on
from pdhpc.scene.sections import section
from pdhpc.scene.static import static_problem
from pdhpc.scene.steps import choose_step


def build(scene, comm):
    """Return the problem of `scene` on this rank, as its model has it; every rank makes its own share in place. Collective.

    Raises
    ------
    SceneError, on every rank: a region, load, crack or probe that selects nothing, a step above the critical one, bodies that overlap,
    an impactor that starts inside a body.
    """
    if scene.model == "fem":
        from pdhpc.scene.elastic import build_elastic

        return build_elastic(scene, comm)
    if scene.model == "gfem":
        from pdhpc.scene.coupled import build_coupled

        return build_coupled(scene, comm)
    return _build_particles(scene, comm)


def _build_particles(scene, comm):
    """Return the Problem of a scene of particles. Collective."""
    body = make_body(scene, comm)
    if scene.method != "single" and not scene.stands_still:
        return _build_regions(scene, body, comm)
    part = make_part(scene, body, comm, partition_of(scene, body, comm))
    _furnish(scene, body, [part], comm)
    remarks = remarks_on(scene, body, amounts_of(scene, body, [part], comm)) + overlaps(scene, body, part, comm)
    if scene.stands_still:
        problem = static_problem(scene, body, part, comm)
        problem.warnings += remarks
        return problem
    check_clear(scene, body, part, comm)
    critical = stiffer_step(scene, body, part.critical_dt)
    dt, n_steps, warnings = choose_step(scene, critical)
    warnings += remarks
    if scene.fine is not None:
        warnings.append('[fine] is not used: time.method = "single" takes one step for the whole body')

    def make_stepper(dt):
        part.conditions.interactions = make_interactions(scene, body, part, comm, dt)
        return VelocityVerlet(part.subdomain, body.law, part.conditions, part.exchange.bind, dt)

    return Problem(scene, body, [part], critical, dt, 1, n_steps, warnings, make_stepper)


def _build_regions(scene, body, comm):
    """Return the Problem of a scene with a fine region. Collective."""
    m = 1 if scene.fine.step_ratio == "auto" else scene.fine.step_ratio
    while True:
        regions = make_regions(scene, body, comm, m)
        regions.check_shape()
        _furnish(scene, body, regions.parts, comm)
        dt, n_steps, warnings = choose_step(scene, regions.critical_macro_dt())
        chosen = regions.choose_ratio(dt)
        if chosen <= m or scene.fine.step_ratio != "auto":
            break
        m = chosen  # the shares of the ranks depend on it
    if "error" in scene.time.model_fields_set and scene.fine.step_ratio != "auto":
        warnings.append('time.error is not used: fine.step_ratio is given, not "auto"')
    warnings += regions.check(dt) + remarks_on(scene, body, amounts_of(scene, body, regions.parts, comm))
    critical = min(part.critical_dt_of(comm) for part in regions.parts)
    return Problem(scene, body, regions.parts, critical, dt, m, n_steps, warnings, regions.stepper, regions)


def _furnish(scene, body, parts, comm):
    """Correct surfaces, cut pre-cracks, and give the parts their conditions, initial state and critical step. Collective."""
    if comm.allreduce(sum(part.subdomain.particles.n_owned for part in parts)) == 0:
        raise scene.error("body", "no particle", "a body that is not wholly a hole")
    for name in scene.damage.no_fail:
        select_particles(scene, body, parts, comm, name, "damage.no_fail")
    if scene.particles.surface_correction != "none":
        for part in parts:
            part.correct_surfaces(body, scene.particles.surface_correction)
    cut_cracks(scene, parts, comm)
    for part in parts:
        part.settle_bonds(body.law)
    for part, conditions in zip(parts, make_conditions(scene, body, parts, comm)):
        part.conditions = conditions
    set_initial_state(scene, body, parts, comm)
    for part in parts:
        part.find_critical_step(body.law)


def cut_cracks(scene, parts, comm):
    """Cut the bonds that cross the pre-cracks. Collective."""
    for number, crack in enumerate(scene.crack):
        if crack.type == "polyline":
            facets = cracks.polyline(crack.points)
        elif crack.type == "rectangle":
            facets = cracks.rectangle(crack.corner, crack.edge1, crack.edge2)
        else:
            facets = cracks.disk(crack.center, crack.normal, crack.radius)
        if comm.allreduce(sum(cut_by_cracks(part.subdomain.bonds, part.subdomain.points, facets) for part in parts)) == 0:
            raise scene.error(section("crack", number, crack), "a crack that cuts no bond", "a crack that crosses a body")
