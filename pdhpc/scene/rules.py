"""Rules between the keys of a scene that types alone cannot hold; each broken one raises a Rule with section, key, finding and what is allowed."""
import difflib

from pdhpc.scene.fields import Rule, check_direction, check_vector
from pdhpc.scene.schema import COMPONENTS, KIND, POISSONS_RATIO

_WHOLE = 1e-6  # relative to the spacing: how closely a box must hold a whole number of cells
_MOST_CELLS = 2**53
_MOST_TIMES = 10**6


def check(scene):
    """Raise a Rule for the first rule that the scene breaks."""
    _check_particles(scene)
    _check_materials(scene)
    _check_bodies(scene)
    _check_regions(scene)
    _check_cracks(scene)
    _check_loads(scene)
    _check_times(scene)
    _check_probes(scene)


def nearest(word, words):
    """Return ' (did you mean "..."?)' for the nearest of `words`, or nothing."""
    found = difflib.get_close_matches(str(word), [str(each) for each in words], n=1, cutoff=0.5)
    return f' (did you mean "{found[0]}"?)' if found else ""


def section(name, number, table):
    """Return how a table of a list is called: load 'pull', or load[2] without a name."""
    label = getattr(table, "name", None)
    return f"{name} '{label}'" if label else f"{name}[{number}]"


def _within(where, action, *arguments):
    """Call a check and put the section before the key of the Rule it raises."""
    try:
        action(*arguments)
    except Rule as rule:
        raise Rule(f"{where}: {rule.key}", rule.found, rule.allowed) from None


def _named(tables, name):
    """Raise a Rule when two tables share a name."""
    seen = set()
    for number, table in enumerate(tables):
        if table.name is not None and table.name in seen:
            raise Rule(f"{name}[{number}]: name", f'"{table.name}"', f"a name that no other {name} has")
        seen.add(table.name)


def _reference(where, key, name, names, what):
    """Raise a Rule unless `name` is one of `names`."""
    if name not in names:
        allowed = f"the name of a {what} ({', '.join(sorted(names)) or 'none is defined'}){nearest(name, names)}"
        raise Rule(f"{where}: {key}", f'"{name}"', allowed)


def _check_particles(scene):
    setting = scene.particles
    if setting.horizon < 2 * setting.spacing * (1 - 1e-9):
        raise Rule("particles.horizon", setting.horizon, f"at least 2 spacings, {2 * setting.spacing:g} m")
    if setting.horizon > 100 * setting.spacing:
        raise Rule("particles.horizon", setting.horizon, f"at most 100 spacings, {100 * setting.spacing:g} m")
    if scene.dim == 3 and setting.thickness is not None:
        raise Rule("particles.thickness", setting.thickness, "no thickness in 3D")


def _check_materials(scene):
    _named(scene.material, "material")
    used = {body.material for body in scene.body}
    for number, body in enumerate(scene.body):
        _reference(section("body", number, body), "material", body.material, [material.name for material in scene.material], "material")
    for number, material in enumerate(scene.material):
        where = section("material", number, material)
        expected = POISSONS_RATIO[scene.dimension]
        if material.poissons_ratio is not None and abs(material.poissons_ratio - expected) > 1e-3:
            words = "1/3" if scene.dimension == "plane_stress" else "1/4"
            raise Rule(f"{where}: poissons_ratio", material.poissons_ratio, f"{words} or no value: a bond-based material fixes it in {scene.dimension}")
        if material.energy_release_rate is not None and material.critical_stretch is not None:
            raise Rule(f"{where}: critical_stretch", material.critical_stretch, "one of energy_release_rate and critical_stretch, not both")
        if material.name not in used:
            raise Rule(f"{where}: name", f'"{material.name}"', "a material that a body uses; this one is unused")


def _check_bodies(scene):
    _named(scene.body, "body")
    spacing, boxes, cells = scene.particles.spacing, [], 0
    for number, body in enumerate(scene.body):
        where = section("body", number, body)
        _within(where, body.check, scene.dim)
        lower, upper = body.bounding_box()
        sides = [high - low for low, high in zip(lower, upper)]
        if body.shape == "box":
            for axis, side in zip("xyz", sides):
                _check_side(where, axis, side, spacing, body.upper)
        size = 1.0
        for side in sides:
            size *= max(1.0, side / spacing)
        cells += size
        if cells > _MOST_CELLS:
            raise Rule("particles.spacing", spacing, f"a spacing that fills the bodies with fewer than 2^53 particles (here about {cells:.3g})")
        for index, hole in enumerate(body.hole):
            inner = f"{where}: hole[{index}]"
            _within(inner, hole.check, scene.dim)
            if hole.shape != "half_space" and not _meet((lower, upper), hole.bounding_box()):
                raise Rule(f"{inner}: shape", f'"{hole.shape}" outside the body', "a hole that meets its body")
        for other, box in boxes:
            if body.shape == "box" == box[2] and _meet((lower, upper), box[:2], -1e-6 * spacing):
                raise Rule(f"{where}: lower", lower, f"a body that does not overlap body '{other}'")
        boxes.append((body.name, (lower, upper, body.shape)))


def _check_side(where, axis, side, spacing, upper):
    """Raise a Rule unless a box side is a whole number of spacings."""
    count = max(1, round(side / spacing))
    if abs(side - count * spacing) > _WHOLE * spacing * max(1.0, 1e-3 * count):
        raise Rule(f"{where}: upper", upper, f"a box whose {axis} side ({side:g} m) is a whole number of spacings; the nearest is {count * spacing:.10g} m")


def _meet(first, second, slack=0.0):
    """Whether two bounding boxes touch or overlap (by more than -slack)."""
    return all(a <= d + slack and c <= b + slack for a, b, c, d in zip(first[0], first[1], second[0], second[1]))


def _meets_a_body(scene, box):
    return any(_meet(box, body.bounding_box()) for body in scene.body)


def _check_regions(scene):
    _named(scene.region, "region")
    _check_region_names(scene)
    used = {each.region for group in (scene.load, scene.initial, scene.tip, scene.probe) for each in group if each.region is not None}
    used |= set(scene.damage.no_fail)
    for number, region in enumerate(scene.region):
        where = section("region", number, region)
        if region.name == "all":
            raise Rule(f"{where}: name", '"all"', "another name: all is built in and holds every particle")
        _within(where, region.check, scene.dim)
        if region.body is not None:
            _reference(where, "body", region.body, [body.name for body in scene.body], "body")
        if not _meets_a_body(scene, region.bounding_box()):
            raise Rule(f"{where}: shape", f'"{region.shape}" outside every body, which selects no particle', "a region that holds at least one particle")
        if region.name not in used:
            raise Rule(f"{where}: name", f'"{region.name}"', "a region that a load, initial state, probe, tip or no_fail uses; this one is unused")


def _check_region_names(scene):
    """Raise a Rule for the first reference to a region that is not there."""
    names = [region.name for region in scene.region] + ["all"]
    for group in ("load", "initial", "tip", "probe"):
        for number, table in enumerate(getattr(scene, group)):
            if table.region is not None:
                _reference(section(group, number, table), "region", table.region, names, "region")
    for name in scene.damage.no_fail:
        _reference("damage", "no_fail", name, names, "region")


def _check_cracks(scene):
    _named([crack for crack in scene.crack if crack.name], "crack")
    for number, crack in enumerate(scene.crack):
        where = section("crack", number, crack)
        _within(where, crack.check, scene.dim)
        if not _meets_a_body(scene, crack.bounding_box()):
            raise Rule(f"{where}: {'points' if crack.type == 'polyline' else 'center' if crack.type == 'disk' else 'corner'}",
                       "a crack outside every body", "a crack that crosses a body")


def _check_loads(scene):
    _named([load for load in scene.load if load.name], "load")
    held = {}
    for number, load in enumerate(scene.load):
        where = section("load", number, load)
        _within(where, load.check, scene.dim)
        if load.type in ("displacement", "velocity"):
            for axis, value in enumerate(load.value):
                if value == "free":
                    continue
                if (load.region, axis) in held:
                    raise Rule(f"{where}: value", load.value, f'"free" in {"xyz"[axis]}, which {held[load.region, axis]} prescribes on the same region')
                held[load.region, axis] = where
    for number, initial in enumerate(scene.initial):
        _within(f"initial[{number}]", initial.check, scene.dim)


def _check_times(scene):
    time, output = scene.time, scene.output
    if time.safety > 1:
        raise Rule("time.safety", time.safety, "a number above 0 and at most 1")
    if time.dt != "auto" and time.dt > time.end:
        raise Rule("time.dt", time.dt, f"a step of at most time.end = {time.end:g} s")
    given = [name for name in ("every", "frames", "times") if getattr(output, name) is not None]
    if len(given) > 1:
        raise Rule(f"output.{given[1]}", getattr(output, given[1]), f"only one of every, frames and times ({given[0]} is given too)")
    for number in output.times or []:
        if not 0 < number <= time.end * (1 + 1e-12):
            raise Rule("output.times", number, f"times above 0 and up to time.end = {time.end:g} s")
    for name in ("every", "history_every"):
        interval = getattr(output, name)
        if interval is not None and not time.end / _MOST_TIMES <= interval <= time.end * (1 + 1e-12):
            raise Rule(f"output.{name}", interval, f"an interval from {time.end / _MOST_TIMES:g} s up to time.end = {time.end:g} s")
    if (output.frames or 1) > _MOST_TIMES:
        raise Rule("output.frames", output.frames, f"at most {_MOST_TIMES} frames")
    twice = [name for name in output.fields if output.fields.count(name) > 1]
    if twice:
        raise Rule("output.fields", f'"{twice[0]}" twice', "each field once")


def _check_probes(scene):
    for group in ("probe", "curve", "tip"):
        _named(getattr(scene, group), group)
    columns = set()
    for number, probe in enumerate(scene.probe):
        where = section("probe", number, probe)
        check_one = [name for name in ("point", "region") if getattr(probe, name) is not None]
        if len(check_one) != 1:
            raise Rule(f"{where}: point", "and region both given" if check_one else "nothing", "exactly one of point and region")
        _within(where, check_vector, "point", probe.point, scene.dim)
        if probe.quantity == "reaction" and probe.region is None:
            raise Rule(f"{where}: quantity", '"reaction"', "a region: a single point has no reaction")
        columns |= {f"{probe.name}.{probe.quantity}{suffix}" for suffix in COMPONENTS[scene.dim][KIND[probe.quantity]]}
    for number, curve in enumerate(scene.curve):
        for name in ("x", "y"):
            _reference(section("curve", number, curve), name, getattr(curve, name), columns, "probe component")
    for number, tip in enumerate(scene.tip):
        where = section("tip", number, tip)
        if tip.name in {probe.name for probe in scene.probe}:
            raise Rule(f"{where}: name", f'"{tip.name}"', "a name that no probe has")
        _within(where, check_direction, "direction", tip.direction, scene.dim)
        if tip.threshold >= 1:
            raise Rule(f"{where}: threshold", tip.threshold, "a number above 0 and below 1")
        if tip.window > scene.time.end:
            raise Rule(f"{where}: window", tip.window, f"at most time.end = {scene.time.end:g} s")
