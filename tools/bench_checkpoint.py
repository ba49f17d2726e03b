"""Checkpoints of a million particles with 122 neighbours: seconds to write and to go on from, and bytes a particle. See bench.py."""
import json
import sys
import tempfile
import time
from pathlib import Path

SCENE = Path(__file__).resolve().parents[1] / "runs" / "studies" / "block_3d.toml"


def checkpoint(worker, spread):
    """Print seconds of writing and of going on, against the set-up of the run; worker, spread : of bench.py."""
    for ranks in (1, 2):
        results = [worker(["checkpoint-rank"], ranks=ranks) for _ in range(3)]
        write, again = ([each[name] for each in results] for name in ("write", "again"))
        setup = spread([each["again"] / each["setup"] for each in results])
        print(f"checkpoint: {ranks} rank(s): written in {spread(write)} s, gone on from in {spread(again)} s, {setup} of the set-up, {results[0]['bytes']:.0f} bytes a particle")


def checkpoint_rank():
    """One rank of `checkpoint`."""
    from pdhpc.output.checkpoint import generations, read_header, restore, write_checkpoint
    from pdhpc.scene.read import read_scene
    from pdhpc.simulation import Simulation

    simulation = Simulation(read_scene(SCENE))
    comm, stepper = simulation.comm, simulation.stepper
    folder = comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None)
    times = []
    for _ in range(3):
        comm.Barrier()
        started = time.perf_counter()
        write_checkpoint(comm, folder, {"step": 0}, stepper.state())
        comm.Barrier()
        times.append(time.perf_counter() - started)
    path = generations(folder)[0]
    comm.Barrier()
    started = time.perf_counter()
    restore(comm, path, read_header(path), stepper.state())
    stepper.resume()
    comm.Barrier()
    again = time.perf_counter() - started
    if comm.rank == 0:
        print(json.dumps({"write": min(times), "again": again, "setup": simulation.seconds["setup"], "bytes": path.stat().st_size / 1e6}))
        sys.stdout.flush()
        path.unlink()
