"""The time step of a scene."""
import math


def choose_step(scene, critical, most=1.0):
    """Return (dt, number of steps, warnings): the scene's step, or safety times the critical one so that whole steps reach the end.

    most : share of the critical step up to which a given step is accepted.

    Raises
    ------
    SceneError: a given step above that without allow_unstable; "auto" although nothing has a critical step.
    """
    setting = scene.time
    if setting.dt == "auto":
        if not math.isfinite(critical):
            raise scene.error("time.dt", '"auto" although no particle has a bond', "a number of seconds")
        n_steps = max(1, math.ceil(setting.end / (scene.safety * critical)))
        return setting.end / n_steps, n_steps, []
    n_steps = max(1, math.ceil(setting.end / setting.dt * (1 - 1e-12)))
    if setting.dt <= most * critical:
        return setting.dt, n_steps, []
    words = f"the critical {critical:.6g} s" if most == 1.0 else f"{most} of the critical {critical:.6g} s, {most * critical:.6g} s"
    if not setting.allow_unstable:
        raise scene.error("time.dt", f"{setting.dt:g} s", f'"auto" or a step up to {words}, unless time.allow_unstable = true')
    above = f"the critical step {critical:.6g} s" if most == 1.0 else words
    return setting.dt, n_steps, [f"time.dt = {setting.dt:g} s is above {above} (allow_unstable is set)"]
