"""Rules of contact and impactors; see rules.py."""
from pdhpc.scene.fields import Rule
from pdhpc.scene.sections import named, section, within

_LARGEST_DAMPING = 0.5


def check_contact(scene):
    """Raise a Rule for contact or impactors that are impossible, or that the scene's model and method do not know."""
    if scene.contact is None and not scene.impactor:
        return
    key_of, found = ("contact", "a table") if scene.contact is not None else ("impactor", "one or more tables")
    if scene.model != "particles":
        raise Rule(key_of, f'{found} with model = "{scene.model}"', 'none there: only model = "particles" knows contact and impactors')
    if scene.stands_still:
        allowed = f"no such table: contact is not offered where bodies are brought to rest; bodies that meet need steps in time (time.method = \"single\")"
        raise Rule(key_of, f'{found} with time.method = "{scene.method}"', allowed)
    if scene.particles.kinematics != "finite":
        raise Rule("particles.kinematics", f'"{scene.particles.kinematics}" with {key_of}', '"finite": where bodies meet is seen in their current positions')
    if scene.method != "single":
        raise Rule("time.method", f'"{scene.method}" with {key_of}', '"single" (and no table [fine]): contact between regions of different steps is not offered')
    if scene.contact is not None and scene.contact.damping > _LARGEST_DAMPING:
        raise Rule("contact.damping", scene.contact.damping, f"a number from 0 to {_LARGEST_DAMPING}: above, the explicit step would not be stable")
    _check_distance(scene)
    named(scene.impactor, "impactor")
    others = {each.name for each in scene.probe} | {each.name for each in scene.tip}
    for number, impactor in enumerate(scene.impactor):
        where = section("impactor", number, impactor)
        if impactor.name in others:
            raise Rule(f"{where}: name", f'"{impactor.name}", which a probe or tip has', "a name that no probe or tip has")
        within(where, impactor.check, scene.dim)


def _check_distance(scene):
    """Raise a Rule for a distance of contact at which particles of a whole body would repel."""
    horizon = max(scene.particles.horizon if body.horizon is None else body.horizon for body in scene.body)
    if scene.contact is not None and scene.contact.distance != "auto" and scene.contact.distance > horizon:
        reason = "particles farther apart are not bonded, and would repel inside a whole body that is pressed"
        raise Rule("contact.distance", scene.contact.distance, f'"auto" (1.35 spacings) or a length up to the largest horizon, {horizon:g} m: {reason}')
