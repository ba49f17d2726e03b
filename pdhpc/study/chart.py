"""Speed against accuracy: one scene by every method and step ratio, against one small step everywhere."""
import csv
import io
import math
import time
from pathlib import Path
from typing import NamedTuple, Optional

import numpy as np

from pdhpc.output.record import write_text
from pdhpc.parallel.comm import largest, on_root, world
from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene, read_text
from pdhpc.scene.schema import SceneError

RATIOS = (1, 2, 4, 5, 10, 20)
METHODS = {"single": (), "polynomial": ("fine.interface=polynomial",), "exact": ("fine.interface=exact",), "kick": ("fine.interface=kick",),
           "subcycling": (), "micro": ()}
"""Methods and what they set beside time.method; those of the interface are multi-time-step runs."""
_SAFE = 0.65  # share of the critical step of the largest macro step
PUBLISHED = {1: (0.0, 0.0), 2: (9.0e-4, 0.25), 10: (9.0e-3, 2.50)}
"""Lindsay, Parks & Prakash 2016, fractured plate: m -> (error, %, gain in speed); one step of 10 dt everywhere: 2.0e-2 %."""
_COLUMNS = ("method", "m", "dt", "macro_dt", "error", "cost", "seconds", "speedup", "broken_bonds", "wrong_particles", "interface_share", "failure")


class Point(NamedTuple):
    """One run. dt, macro_dt, s; error: relative L2 of displacements at the end; cost: bond evaluations over the reference's; seconds: of stepping."""

    method: str
    m: int
    dt: float
    macro_dt: float
    error: float
    cost: float
    seconds: float
    speedup: float
    broken_bonds: int
    wrong_particles: int  # whose damage is not the reference's
    interface_share: float  # of the stepping time, the slowest rank's
    failure: Optional[str] = None


def chart(path, overrides, ratios, methods, directory):
    """Run a scene by every method and step ratio, write DIR/chart.csv, and return [Point], the reference first. Collective over all ranks.

    All runs end at the same time, a whole number of the largest macro steps, which is 0.65 of the critical step; the reference takes that step over the
    largest ratio everywhere, "single" with m takes m times as much.

    Raises
    ------
    SceneError: a scene without a fine region.
    """
    comm = world()
    text = on_root(comm, read_text, path)
    scene = parse_scene(text, str(path), overrides)
    if scene.fine is None:
        raise SceneError(f"{path}: fine = nothing; allowed is a table [fine]: a chart compares ways to give a region a step of its own")
    problem = build(parse_scene(text, str(path), [*overrides, "time.method=single", "time.dt=auto", "fine.interface=auto"]), comm)
    fine_dt = _SAFE * problem.critical_dt / max(ratios)
    common = math.lcm(*ratios)
    count = max(1, round(scene.time.end / (fine_dt * common))) * common

    def run(method, m):
        return _run(comm, text, str(path), overrides, method, m, fine_dt, count)

    reference = run("single", 1)
    points = [_point(comm, "single", 1, fine_dt, reference, reference)]
    for method in methods:
        for m in ratios:
            if (method, m) == ("single", 1) or (method == "kick" and m == 1):
                continue
            points.append(_point(comm, method, m, fine_dt, run(method, m), reference))
            on_root(comm, _write, points, directory)
    return points


class _Outcome(NamedTuple):
    ids: np.ndarray
    displacement: np.ndarray
    damage: np.ndarray
    cost: int
    seconds: float
    broken: int
    interface_share: float
    failure: Optional[str]


def _run(comm, text, path, overrides, method, m, fine_dt, count):
    """Return the _Outcome of one run, with particles spread over ranks by id. Collective."""
    name = method if method in ("single", "subcycling", "micro") else "mts"
    macro_dt = fine_dt * m
    settings = [f"time.method={name}", f"time.dt={macro_dt!r}", f"time.end={fine_dt * count!r}", "fine.interface=auto", f"fine.step_ratio={m}", *METHODS[method]]
    problem = build(parse_scene(text, path, [*overrides, *settings]), comm)
    stepper, failure = problem.stepper(), None
    before = dict(stepper.seconds)
    comm.Barrier()
    started = time.perf_counter()
    while stepper.step < count // m:
        stepper.advance()
    comm.Barrier()
    seconds = time.perf_counter() - started
    spent = {key: value - before[key] for key, value in stepper.seconds.items()}
    stepper.view.prepare()
    fields = [_spread(comm, stepper.view.ids, stepper.view.field(each)) for each in ("displacement", "damage")]
    if not all(comm.allgather(bool(np.isfinite(fields[0][1]).all()))):
        failure = "displacements are not finite"
    return _Outcome(fields[0][0], fields[0][1], fields[1][1], comm.allreduce(sum(stepper.bond_evaluations.values())), seconds,
                    comm.allreduce(stepper.broken) // 2, float(largest(comm, spent.get("interface", 0.0))) / seconds, failure)


def _spread(comm, ids, values):
    """Return (ids, values) of the particles with id % size == rank, in ascending id: the same on any partition. Collective."""
    owner = ids % comm.size
    pieces = comm.alltoall([(ids[owner == rank], values[owner == rank]) for rank in range(comm.size)])
    found = np.concatenate([each[0] for each in pieces])
    order = np.argsort(found)
    return found[order], np.concatenate([each[1] for each in pieces])[order]


def _point(comm, method, m, fine_dt, outcome, reference):
    """Return the Point of a run. Collective."""
    squares = comm.allreduce(np.array([np.sum((outcome.displacement - reference.displacement) ** 2), np.sum(reference.displacement**2)]))
    wrong = comm.allreduce(int((outcome.damage != reference.damage).sum()))
    error = math.sqrt(squares[0] / squares[1]) if squares[1] > 0 else 0.0
    return Point(method, m, fine_dt * (m if method == "single" else 1), fine_dt * m, error, outcome.cost / reference.cost, outcome.seconds,
                 reference.seconds / outcome.seconds, outcome.broken, wrong, outcome.interface_share, outcome.failure)


def _write(points, directory):
    """Write DIR/chart.csv, complete or not at all."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(_COLUMNS)
    writer.writerows(points)
    Path(directory).mkdir(parents=True, exist_ok=True)
    write_text(Path(directory) / "chart.csv", buffer.getvalue())


def report(points, directory):
    """Print the table of a chart, ours beside the published one, and draw chart.png; return its path. Local: rank 0."""
    from rich.console import Console
    from rich.table import Table

    table = Table("method", "m", "error of u, %", "gain in speed", "bond evaluations", "broken bonds", "particles of other damage", "interface's share",
                  "published error, %", "published gain", box=None, padding=(0, 2, 0, 0))
    for point in points:
        published = PUBLISHED.get(point.m) if point.method == "polynomial" else (2.0e-2, None) if (point.method, point.m) == ("single", 10) else None
        cells = ("", "") if published is None else (f"{published[0]:.1e}", "" if published[1] is None else f"{published[1]:.0%}")
        error = point.failure or f"{100 * point.error:.2e}"
        table.add_row(point.method, str(point.m), error, f"{point.speedup - 1:+.0%}", f"{point.cost:.3f}", f"{point.broken_bonds:,}", str(point.wrong_particles),
                      f"{point.interface_share:.0%}", *cells)
    console = Console()
    (console if console.is_terminal else Console(width=200)).print(table)
    return _draw(points, Path(directory))


def _draw(points, directory):
    """Draw error over cost and over time, a line for each method."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, both = pyplot.subplots(1, 2, figsize=(11, 4.6), sharey=True)
    for axes, key, label in zip(both, ("cost", "speedup"), ("bond evaluations, one small step everywhere = 1", "time, one small step everywhere = 1")):
        for method in METHODS:
            chosen = [point for point in points if point.method == method and point.error > 1e-12 and point.failure is None]
            values = [getattr(point, key) if key == "cost" else 1 / point.speedup for point in chosen]
            axes.plot(values, [100 * point.error for point in chosen], "o-", label=method)
            for point, value in zip(chosen, values):
                axes.annotate(str(point.m), (value, 100 * point.error), textcoords="offset points", xytext=(4, 4), fontsize=7)
        axes.set(xlabel=label, xscale="log", yscale="log")
        axes.grid(alpha=0.3, which="both")
    both[0].set_ylabel("error of displacement, %")
    both[0].legend(frameon=False, title="method, with m")
    path = directory / "chart.png"
    figure.savefig(path, dpi=130, bbox_inches="tight")
    pyplot.close(figure)
    return path
