"""The speed of model = "gfem" against particles everywhere: the same lattice, kernels and particle step, interleaved step by step in one process. See bench.py."""
import json
import time

RATIO, CELL, SUB_STEPS = 10, 0.025, 6  # H/h; H, m; k
SCENE = """
model = "{model}"
dimension = "plane_stress"
[particles]
spacing = {h}
horizon = {horizon}
kinematics = "linear"
{method}
[[material]]
name = "glass"
density = 1.0
youngs_modulus = 1.0
critical_stretch = 0.02
[[body]]
name = "plate"
material = "glass"
shape = "box"
lower = [0.0, 0.0]
upper = [2.0, 0.8]
[[crack]]
type = "polyline"
points = [[-0.1, 0.4], [0.3, 0.4]]
[[region]]
name = "top"
shape = "box"
lower = [0.0, 0.775]
upper = [2.0, 0.8]
[[region]]
name = "bottom"
shape = "box"
lower = [0.0, 0.0]
upper = [2.0, 0.025]
[damage]
no_fail = ["top", "bottom"]
[[load]]
type = "traction"
region = "top"
face = "+y"
value = [0.0, {load}]
[[load]]
type = "traction"
region = "bottom"
face = "-y"
value = [0.0, -{load}]
[time]
end = {end}
dt = {dt}
"""


def steppers(end, load):
    """Return (the coupled stepper, its number of steps, [particles everywhere at the same step, at half of it, with 0.1 % more load])."""
    from mpi4py import MPI

    from pdhpc.scene.build import build
    from pdhpc.scene.read import parse_scene

    def made(model, load, dt):
        method = f"[mesh]\ncell_size = {CELL}\n[gfem]\nsubsteps = {SUB_STEPS}" if model == "gfem" else ""
        text = SCENE.format(model=model, h=CELL / RATIO, horizon=3.015 * CELL / RATIO, method=method, load=load, end=end, dt=dt)
        return build(parse_scene(text, "bench"), MPI.COMM_WORLD)

    coupled = made("gfem", load, '"auto"')
    sub_step = coupled.dt / SUB_STEPS
    others = [made("particles", factor * load, repr(dt)).stepper() for factor, dt in ((1.0, sub_step), (1.0, sub_step / 2), (1.001, sub_step))]
    return coupled.stepper(), coupled.n_steps, others


def gfem_rank(end, load):
    """One run: prints seconds of both, shares, errors and sensitivities at the end."""
    import numpy as np

    stepper, n_steps, others = steppers(float(end), float(load))
    seconds, shares = [0.0, 0.0], []
    for step in range(n_steps):
        started = time.perf_counter()
        stepper.advance()
        between = time.perf_counter()
        for _ in range(SUB_STEPS):
            others[0].advance()
        done = time.perf_counter()
        if step:  # the first one loads compiled kernels
            seconds[0], seconds[1] = seconds[0] + between - started, seconds[1] + done - between
        else:
            before = dict(stepper.seconds)
        shares.append(stepper.local.n_active / stepper.view.n)
        for _ in range(2 * SUB_STEPS):
            others[1].advance()
        for _ in range(SUB_STEPS):
            others[2].advance()
    stepper.view.prepare()
    fields = [each.view.field("displacement") for each in (stepper, *others)]
    errors = [float(np.linalg.norm(field - fields[1]) / np.linalg.norm(fields[1])) for field in (fields[0], *fields[2:])]
    spent = {name: value - before[name] for name, value in stepper.seconds.items()}
    around = sum(spent[name] for name in ("choose", "seed", "reconstruct", "solve")) / sum(spent.values())
    print(json.dumps({"gain": seconds[1] / seconds[0], "share": float(np.mean(shares)), "around": around, "spent": {name: round(value / sum(spent.values()), 3) for name, value in spent.items()}, "error": errors[0], "half_step": errors[1], "more_load": errors[2],
                      "milliseconds": [1e3 * each / (n_steps - 1) for each in seconds], "broken": [each.broken // 2 for each in (stepper, *others)]}))
