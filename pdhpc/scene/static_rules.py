"""Rules of scenes whose bodies stand still: what time.method = "relaxation" and "newton" refuse; see rules.py."""
from pdhpc.scene.fields import Rule
from pdhpc.scene.sections import section


def check_static(scene):
    """Raise a Rule for what a body that is brought to rest does not know."""
    if not scene.stands_still:
        return
    method = f'time.method = "{scene.time.method}"'
    if scene.time.dt != "auto":
        raise Rule("time.dt", scene.time.dt, f'"auto": load steps of {method} are static.steps equal parts of time.end')
    if scene.fine is not None:
        raise Rule("fine", "a table", f"none with {method}: all particles are brought to rest together")
    if scene.initial:
        raise Rule("initial", f"{len(scene.initial)} of them", f"none with {method}: the body is unloaded and at rest before the first load step")
    for number, load in enumerate(scene.load):
        if load.type == "velocity":
            raise Rule(f"{section('load', number, load)}: type", '"velocity"', f'"displacement" or a force: nothing moves with {method}')
    if scene.static.breaking == "most_strained":
        for number, material in enumerate(scene.material):
            _check_limit(section("material", number, material), material)
    if scene.output.times is not None and scene.static.steps is None:
        raise Rule("static.steps", "nothing beside output.times", "the number of load steps, equal parts of time.end")


def _check_limit(where, material):
    """Raise a Rule for bonds that the most strained cannot be found of: their limit is no stretch of their materials."""
    if material.failure != "stretch":
        raise Rule("static.breaking", f'"most_strained" with failure = "{material.failure}" of {where}', '"all": the most strained are those of largest s/s0')
    if material.stretch_softening > 0:
        raise Rule("static.breaking", f'"most_strained" with stretch_softening = {material.stretch_softening} of {where}', '"all": s0 is then no number of a material')
    if material.weibull_modulus is not None:
        raise Rule("static.breaking", f'"most_strained" with weibull_modulus = {material.weibull_modulus} of {where}', '"all": s0 is then no number of a material')


def unused_keys(scene):
    """Return a sentence for each key of [time] and [static] that changes nothing."""
    if not scene.stands_still:
        return [f'[static] is not used: time.method = "{scene.time.method}"'] if scene.static is not None else []
    keys = {"safety", "error", "allow_unstable"} & scene.time.model_fields_set
    return [f'time.{key} is not used: time.method = "{scene.time.method}" has no critical step' for key in sorted(keys)]
