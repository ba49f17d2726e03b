"""One launch of a scaling study: build the scene, warm up, time the steps, print a row. Run by scaling.py on every rank."""
import json
import platform
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from pdhpc.parallel.comm import on_root, world
from pdhpc.run import RunError
from pdhpc.study.scaling import PHASES, Study, scene_of_point


def main(path, ranks, study_text):
    """Measure one point of the study in `path` and print its row as JSON on rank 0. Collective."""
    comm, study = world(), Study.model_validate_json(study_text)
    if comm.size != int(ranks):
        raise RunError(f"{ranks} ranks were asked for, {comm.size} started: the launcher and this Python do not use the same MPI")
    row = measure(study, on_root(comm, scene_of_point, study, Path(path).parent, comm.size), comm)
    if comm.rank == 0:
        print(json.dumps(row), flush=True)


def measure(study, scene, comm):
    """Return the row of a scene on this communicator, warm-up and output outside of the timed steps. Collective."""
    from pdhpc.simulation import Simulation

    simulation = Simulation(scene, comm)
    stepper, view, problem = simulation.stepper, simulation.stepper.view, simulation.problem
    for _ in range(study.warm_up):
        stepper.advance()
    before = dict(stepper.seconds)
    comm.Barrier()
    started = time.perf_counter()
    for _ in range(study.steps):
        stepper.advance()
    seconds = time.perf_counter() - started
    phases = np.array([stepper.seconds.get(name, 0.0) - before.get(name, 0.0) for name in PHASES])
    work = sum(steps * part.subdomain.bonds.n_directed for part, steps in zip(problem.parts, (1, problem.m)))
    ghosts = sum(part.subdomain.particles.n_ghost for part in problem.parts)
    per_rank = np.array(comm.allgather([seconds, *phases, view.n, view.directed_bonds(), ghosts, stepper.bytes_sent, work]))
    seconds, force, owned, bonds, work = per_rank[:, 0].max(), per_rank[:, 1], *per_rank[:, 6:8].T, per_rank[:, 10]
    row = {
        "host": platform.node(), "ranks": comm.size, "path": problem.body.path.split(":")[0], "particles": int(owned.sum()),
        "bonds": int(bonds.sum()) // 2, "steps": study.steps, "seconds": float(seconds), "setup": simulation.seconds["setup"],
        "bond_imbalance": float(work.max() / work.mean()), "force_imbalance": float(force.max() / force.mean()),
        "ghosts": int(per_rank[:, 8].sum()), "bytes_per_step": int(per_rank[:, 9].sum()),
        "particle_steps_per_second_and_core": float(owned.sum() * study.steps / (seconds * comm.size)),
    }
    for number, name in enumerate(PHASES):
        row[f"{name}_mean"], row[f"{name}_slowest"] = float(per_rank[:, 1 + number].mean()), float(per_rank[:, 1 + number].max())
    row["output"] = _time_frame(simulation, comm) if study.output else 0.0
    return row


def _time_frame(simulation, comm):
    """Return the seconds that one frame of displacement and damage takes. Collective."""
    from pdhpc.output.fields import FieldWriter

    folder = on_root(comm, tempfile.mkdtemp, "", "pdhpc-frame-", ".")
    view = simulation.stepper.view
    view.prepare()
    writer = FieldWriter(comm, folder, {"scene": "", "version": "", "ranks": comm.size})
    writer.write_points(view.ids, view.places(), view.volume, view.block, view.cells)
    comm.Barrier()
    started = time.perf_counter()
    writer.write_frame(0, 0.0, {name: view.field(name) for name in ("displacement", "damage")})
    comm.Barrier()
    seconds = time.perf_counter() - started
    on_root(comm, _remove, folder)
    return seconds


def _remove(folder):
    import shutil

    shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
