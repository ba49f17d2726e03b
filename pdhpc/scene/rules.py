"""Rules between the keys of a scene that types alone cannot hold; each broken one raises a Rule with section, key, finding and what is allowed."""
from pdhpc.scene import law_rules, mesh_rules, point_rules
from pdhpc.scene.contact_rules import check_contact
from pdhpc.scene.fields import Rule, check_direction, check_vector
from pdhpc.scene.overlap import distance, meet, overlap, reaches
from pdhpc.scene.schema import COMPONENTS, KIND, POISSONS_RATIO
from pdhpc.scene.sections import named, reference, section, within
from pdhpc.scene.static_rules import check_static

_WHOLE = 1e-6  # of a spacing: how closely a box must hold a whole number of cells, and bodies may overlap
_MOST_CELLS = 2**53
_MOST_TIMES = 10**6
_MOST_STEPS = 1e12
OF_IMPACTORS = ("position", "velocity", "force")
"""What history.csv holds of an impactor."""
_FARTHEST = 1e9  # spacings from the origin up to which doubles resolve the lattice


def check(scene):
    """Raise a Rule for the first rule that the scene breaks."""
    mesh_rules.check_model(scene)
    point_rules.check_points(scene)
    if scene.uses_lattice:
        _check_particles(scene)
    _check_materials(scene)
    if scene.from_file:
        named(scene.body, "body")
    else:
        _check_bodies(scene)
    law_rules.check_laws(scene)
    _check_regions(scene)
    _check_cracks(scene)
    _check_loads(scene)
    _check_time(scene)
    check_static(scene)
    _check_fine(scene)
    check_contact(scene)
    _check_output(scene)
    _check_probes(scene)
    _check_curves_and_tips(scene)
    _check_fragments(scene)


def _check_particles(scene):
    setting = scene.particles
    if setting.horizon < 2 * setting.spacing * (1 - 1e-9):
        raise Rule("particles.horizon", setting.horizon, f"at least 2 spacings, {2 * setting.spacing:g} m")
    if setting.horizon > 100 * setting.spacing:
        raise Rule("particles.horizon", setting.horizon, f"at most 100 spacings, {100 * setting.spacing:g} m")


def _check_materials(scene):
    named(scene.material, "material")
    used = {body.material for body in scene.body}
    expected = POISSONS_RATIO[scene.dimension]
    for number, material in enumerate(scene.material):
        where = section("material", number, material)
        if material.model != scene.material[0].model:
            first = scene.material[0]
            raise Rule(f"{where}: model", f'"{material.model}"', f'"{first.model}", the model of material \'{first.name}\': all materials of a scene share one')
        mesh_rules.check_material(scene, where, material)
        (_check_bond_based if material.model == "pmb" else _check_linear_solid)(scene, where, material, expected)
        if material.energy_release_rate is not None and material.critical_stretch is not None:
            raise Rule(f"{where}: critical_stretch", f"{material.critical_stretch} beside energy_release_rate", "one of the two, not both")
    names = [material.name for material in scene.material]
    for number, body in enumerate(scene.body):
        reference(f"{section('body', number, body)}: material", body.material, names, "material")
    for name in names:
        if name not in used:
            raise Rule(f"material '{name}': name", f'"{name}", which no body uses', "a material that a body uses")


def _check_bond_based(scene, where, material, expected):
    if material.youngs_modulus is None:
        raise Rule(f"{where}: youngs_modulus", "nothing", 'a number above 0, Pa: model = "pmb" needs it')
    for key in ("bulk_modulus", "shear_modulus"):
        if getattr(material, key) is not None:
            raise Rule(f"{where}: {key}", getattr(material, key), 'no such key in model = "pmb", which has youngs_modulus alone (model = "lps" takes both)')
    if material.poissons_ratio is not None and abs(material.poissons_ratio - expected) > 1e-3:
        words = "1/3" if scene.dimension == "plane_stress" else "1/4"
        allowed = f'{words} (or no such key): a bond-based material fixes it in dimension = "{scene.dimension}" (model = "lps" does not)'
        raise Rule(f"{where}: poissons_ratio", material.poissons_ratio, allowed)


def _check_linear_solid(scene, where, material, expected):
    pairs = ("youngs_modulus", "poissons_ratio"), ("bulk_modulus", "shear_modulus")
    given = [key for pair in pairs for key in pair if getattr(material, key) is not None]
    if tuple(given) not in pairs:
        missing = next(iter([key for pair in pairs if set(given) & set(pair) for key in pair if key not in given]), "youngs_modulus")
        found = f"nothing beside {' and '.join(given)}" if len(given) == 1 else ("nothing" if not given else f"a value beside {' and '.join(given)}")
        key = missing if len(given) < 2 else given[-1]
        raise Rule(f"{where}: {key}", found, f'youngs_modulus and poissons_ratio, or bulk_modulus and shear_modulus, for model = "{material.model}"')
    if material.poissons_ratio is not None and not -1 < material.poissons_ratio < 0.5:
        raise Rule(f"{where}: poissons_ratio", material.poissons_ratio, "a number above -1 and below 0.5")


def _check_bodies(scene):
    named(scene.body, "body")
    cells = 0
    for number, body in enumerate(scene.body):
        where = section("body", number, body)
        if body.file is not None:
            continue
        spacing = scene.spacing_of(body)
        within(where, body.check, scene.dim)
        within(where, _check_cells, body, spacing, "spacings" if scene.uses_lattice else "cells")
        cells += cells_of(body, spacing)
        if cells > _MOST_CELLS:
            raise Rule("particles.spacing" if scene.uses_lattice else "mesh.cell_size", spacing, f"a length that fills the bodies with fewer than 2^53 cells (here about {cells:.3g})")
        _check_holes(where, body, scene.dim)
        for other in scene.body[:number]:
            if other.file is None and overlap(body, other, _WHOLE * spacing):
                key = "lower" if body.shape == "box" else "start" if body.shape == "cylinder" else "center"
                raise Rule(f"{where}: {key}", getattr(body, key), f"a body that does not overlap body '{other.name}' (touching is fine, and lying in its hole)")


def _check_cells(body, spacing, what):
    """Raise a Rule unless the lattice (or the mesh) fits the body: a box holds whole cells, and doubles resolve the coordinates."""
    lower, upper = body.bounding_box()
    farthest = max(abs(x) for x in lower + upper)
    if farthest > _FARTHEST * spacing:
        raise Rule("shape", f'"{body.shape}" that reaches to {farthest:g} m', f"coordinates within 1e9 {what} ({_FARTHEST * spacing:g} m) of the origin")
    for axis, low, high in zip("xyz", lower, upper):
        count = max(1, round((high - low) / spacing))
        if body.shape == "box" and abs(high - low - count * spacing) > _WHOLE * spacing + 1e-15 * farthest:
            size = f"{axis} side ({high - low:.10g} m)"
            raise Rule("upper", body.upper, f"a box whose {size} is a whole number of {what}; the nearest is {count * spacing:.10g} m")


def cells_of(body, spacing):
    """Return about how many lattice cells the bounding box of a body holds."""
    number = 1.0
    for low, high in zip(*body.bounding_box()):
        number *= max(1.0, (high - low) / spacing)
    return number


def _check_holes(where, body, dim):
    for number, hole in enumerate(body.hole):
        within(f"{where}: hole[{number}]", hole.check, dim)
        if not reaches(hole, body.bounding_box()):
            raise Rule(f"{where}: hole[{number}]: shape", f'"{hole.shape}" outside the body', "a hole that meets its body")


def _check_regions(scene):
    named(scene.region, "region")
    bodies = {body.name: None if body.file is not None else body.bounding_box() for body in scene.body}
    for number, region in enumerate(scene.region):
        where = section("region", number, region)
        if region.name == "all":
            raise Rule(f"{where}: name", '"all"', "another name: all is built in and holds every particle")
        within(where, region.check, scene.dim)
        if region.body is not None:
            reference(f"{where}: body", region.body, bodies, "body")
        boxes = bodies.values() if region.body is None else [bodies[region.body]]
        if not scene.from_file and region.shape != "group" and not any(box is None or reaches(region, box) for box in boxes):
            outside = "every body" if region.body is None else f"body '{region.body}'"
            raise Rule(f"{where}: shape", f'"{region.shape}" outside {outside}, which selects no particle', "a region that holds at least one particle")
    _check_uses_of_regions(scene)


def _check_uses_of_regions(scene):
    """Raise a Rule for a region that is used but not there, or there but not used."""
    groups = (("load", scene.load), ("initial", scene.initial), ("probe", scene.probe), ("tip", scene.tip))
    names, used = [region.name for region in scene.region] + ["all"], set(scene.damage.no_fail)
    for number, name in enumerate(scene.damage.no_fail):
        reference(f"damage.no_fail[{number}]", name, names, "region")
        if name in scene.damage.no_fail[:number]:
            raise Rule(f"damage.no_fail[{number}]", f'"{name}" again', "each region once")
    for group, tables in groups:
        for number, table in enumerate(tables):
            if table.region is not None:
                reference(f"{section(group, number, table)}: region", table.region, names, "region")
                used.add(table.region)
    for region in scene.region:
        if region.name not in used:
            found = f'"{region.name}", which nothing uses'
            raise Rule(f"region '{region.name}': name", found, "a region that a load, initial, probe, tip or damage.no_fail uses")


def _check_cracks(scene):
    named(scene.crack, "crack")
    for number, crack in enumerate(scene.crack):
        where = section("crack", number, crack)
        within(where, crack.check, scene.dim)
        if not any(body.file is not None or meet(crack.bounding_box(), body.bounding_box()) for body in scene.body):
            key = {"polyline": "points", "rectangle": "corner", "disk": "center"}[crack.type]
            raise Rule(f"{where}: {key}", "a crack outside every body", "a crack that crosses a body")


def _check_loads(scene):
    named(scene.load, "load")
    held = {}
    for number, load in enumerate(scene.load):
        where = section("load", number, load)
        within(where, load.check, scene.dim)
        if load.type in ("displacement", "velocity"):
            for axis, value in enumerate(load.value):
                if value == "free":
                    continue
                if (load.region, axis) in held:
                    raise Rule(f"{where}: value", load.value, f'"free" in {"xyz"[axis]}, which {held[load.region, axis]} prescribes on the same region')
                held[load.region, axis] = where
    for number, initial in enumerate(scene.initial):
        within(f"initial[{number}]", initial.check, scene.dim)


def _check_time(scene):
    time = scene.time
    if time.dt != "auto" and not time.end / _MOST_STEPS <= time.dt <= time.end:
        raise Rule("time.dt", time.dt, f'"auto" or a step from time.end/1e12 = {time.end / _MOST_STEPS:g} s to time.end = {time.end:g} s')


def _check_fine(scene):
    fine, method = scene.fine, scene.time.method
    if fine is None:
        if method not in ("auto", "single") and not scene.stands_still:
            raise Rule("time.method", f'"{method}" without a fine region', '"auto", "single", "relaxation" or "newton", or a table [fine]')
        return
    within("fine", fine.check, scene.dim)
    if not any(body.file is not None or reaches(fine, body.bounding_box()) for body in scene.body):
        raise Rule("fine: shape", f'"{fine.shape}" outside every body', "a fine region that holds at least one particle")
    least = 2 if scene.material[0].model == "lps" else 1
    if not least <= scene.overlap <= 100:
        words = "forces of lps reach two horizons" if least == 2 else "no bond may join the two regions beside it"
        raise Rule("fine: overlap", fine.overlap, f"{least} to 100 horizons: {words}")
    if scene.material[0].model == "lps" and method == "subcycling":
        raise Rule("time.method", '"subcycling" with model = "lps"', '"mts", "micro" or "single": sub-cycling is there for pmb only')
    if fine.interface != "auto" and method in ("single", "subcycling", "micro"):
        raise Rule("fine: interface", f'"{fine.interface}" with time.method = "{method}"', 'no such key, or time.method = "mts"')


def _check_output(scene):
    end, output = scene.time.end, scene.output
    given = [name for name in ("every", "frames", "times") if getattr(output, name) is not None]
    if len(given) > 1:
        raise Rule(f"output.{given[1]}", f"{getattr(output, given[1])} beside output.{given[0]}", "only one of every, frames and times")
    last = 0.0
    for number, time in enumerate(output.times or []):
        if not last < time <= end * (1 + 1e-12):
            raise Rule(f"output.times[{number}]", time, f"a time after {last:g} s and up to time.end = {end:g} s: times increase")
        last = time
    for name in ("every", "history_every"):
        interval = getattr(output, name)
        if interval is not None and not end / _MOST_TIMES <= interval <= end * (1 + 1e-12):
            raise Rule(f"output.{name}", interval, f"an interval from {end / _MOST_TIMES:g} s up to time.end = {end:g} s")
    for number, name in enumerate(output.fields):
        if name in output.fields[:number]:
            raise Rule(f"output.fields[{number}]", f'"{name}" again', "each field once")


def _check_probes(scene):
    named(scene.probe, "probe")
    for number, probe in enumerate(scene.probe):
        where = section("probe", number, probe)
        if (probe.point is None) == (probe.region is None):
            found = "nothing, and no region" if probe.point is None else f"{probe.point} beside region"
            raise Rule(f"{where}: point", found, "exactly one of point and region")
        if probe.quantity == "reaction" and probe.region is None:
            raise Rule(f"{where}: quantity", '"reaction" at a point', "a reaction over a region, or another quantity")
        if probe.point is not None:
            within(where, check_vector, "point", probe.point, scene.dim)
            reach, words = (scene.particles.horizon, "horizon") if scene.uses_lattice else (scene.mesh.cell_size, "cell")
            if not scene.from_file and not scene.brings_points and min(distance(probe.point, body.bounding_box()) for body in scene.body) > reach:
                raise Rule(f"{where}: point", probe.point, f"a point in a body, or within a {words} of one")


def _check_curves_and_tips(scene):
    named(scene.curve, "curve")
    named(scene.tip, "tip")
    probes = {probe.name for probe in scene.probe}
    columns = [f"{probe.name}.{probe.quantity}{end}" for probe in scene.probe for end in COMPONENTS[scene.dim][KIND[probe.quantity]]]
    columns += [f"{impactor.name}.{word}{end}" for impactor in scene.impactor for word in OF_IMPACTORS for end in COMPONENTS[scene.dim]["vector"]]
    for number, curve in enumerate(scene.curve):
        for name in ("x", "y"):
            reference(f"{section('curve', number, curve)}: {name}", getattr(curve, name), columns, "probe's or impactor's component")
    for number, tip in enumerate(scene.tip):
        where = section("tip", number, tip)
        if tip.name in probes:
            raise Rule(f"{where}: name", f'"{tip.name}", which a probe has', "a name that no probe has")
        within(where, check_direction, "direction", tip.direction, scene.dim)
        if tip.window > scene.time.end and "window" in tip.model_fields_set:
            raise Rule(f"{where}: window", tip.window, f"at most time.end = {scene.time.end:g} s")


def _check_fragments(scene):
    if scene.fragments is None:
        if "fragment" in scene.output.fields:
            raise Rule("output.fields", '"fragment" without a table [fragments]', "a table [fragments], which may be empty, or other fields")
        return
    if scene.uses_mesh:
        raise Rule("fragments", f'a table beside model = "{scene.model}"', 'no such table, or model = "particles"')
    if scene.method != "single":
        raise Rule("fragments", f'a table beside time.method = "{scene.method}"', 'no such table, or one step for the whole body (time.method = "single")')
