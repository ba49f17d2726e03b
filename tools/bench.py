"""Benchmarks of pdhpc, as ratios of interleaved runs: kernels against LAMMPS, runs against their kernels, ranks, set-up and memory, start-up, coupled regions, finite
elements. See tools/bench."""
import json
import os
import re
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from bench_checkpoint import checkpoint, checkpoint_rank
from bench_contact import contact, contact_rank
from bench_gfem import gfem_rank

ROUNDS = 5
SIDE = 46  # particles per side of the cube of the kernels' benchmark: 97,336, with 122 neighbours
LAMMPS_STEPS = 10
LAMMPS_INPUT = """
units si
boundary s s s
atom_style peri
atom_modify map array
neighbor 0.0001 bin
lattice sc 0.0005
variable L equal 46*0.0005-0.00025
region target block -0.0001 $L -0.0001 $L -0.0001 $L units box
create_box 1 target
create_atoms 1 region target
{pair}
set group all density 2200
set group all volume 1.25e-10
velocity all set 0 0 0 sum no units box
fix 1 all nve
timestep 1.0e-8
velocity all ramp vx -1.0 1.0 x 0 $L units box
{stretch}
run 2
run {steps}
"""
STRETCH_ALL = """velocity all ramp vy -1.0 1.0 y 0 $L units box sum yes
velocity all ramp vz -1.0 1.0 z 0 $L units box sum yes"""
PAIRS = {
    "pmb": "pair_style peri/pmb\npair_coeff * * 1.6863e22 0.0015001 0.01 0.25",
    "lps": "pair_style peri/lps\npair_coeff * * 14.9e9 8.94e9 0.0015001 0.01 0.25",
    "contact": "pair_style peri/pmb\npair_coeff * * 1.6863e22 0.0015001 1e-12 0.0",  # every bond breaks at once: what is left is the contact search
}
SCENE = """
dimension = "{dimension}"
[particles]
spacing = 1e-3
horizon = 3e-3
volume_correction = "none"
path = "{path}"
[[material]]
name = "glass"
density = 2200
youngs_modulus = 70e9
energy_release_rate = 10
[[body]]
name = "block"
material = "glass"
shape = "box"
lower = {lower}
upper = {upper}
[[initial]]
region = "all"
velocity_gradient = {gradient}
[time]
end = {end}
dt = 1e-9
[output]
pictures = false
frames = 1
history_every = 1e-7
"""
FLOPS = {("pmb", 3): 28, ("pmb", 2): 22, ("lps", 3): 55, ("lps", 2): 45}  # per directed bond: additions and multiplications, a fused one counted twice, rsqrt as 12
ROOT = Path(__file__).resolve().parents[1]


def scene_text(dim, cells, path, steps):
    """Return a block of `cells` per side that runs `steps` steps, energies every 100 of them."""
    gradient = [[1.0 if a == b == 0 else 0.0 for b in range(dim)] for a in range(dim)]
    upper = [count * 1e-3 for count in (cells if isinstance(cells, (list, tuple)) else [cells] * dim)]
    return SCENE.format(
        dimension="3d" if dim == 3 else "plane_stress", path=path, lower=[0.0] * dim, upper=upper, gradient=gradient, end=steps * 1e-9
    )


def kernel():
    """Particle-steps per second and core of the force kernels, and their ratios to LAMMPS on the same points."""
    lammps = shutil.which("lmp") or shutil.which("lammps")
    rates = {}
    for _ in range(ROUNDS):
        for choice in ("vector", "ieee"):
            for name, rate in _worker(["rates"], {"PDHPC_KERNELS": choice} if choice == "ieee" else {}).items():
                rates.setdefault(f"{name}{' (sqrt, division)' if choice == 'ieee' else ''}", []).append(rate)
        for name in PAIRS if lammps else ():
            rates.setdefault(f"LAMMPS {name}", []).append(_lammps(lammps, name))
    for name, values in rates.items():
        print(f"kernel: {name:36s} {statistics.median(values) / 1e6:6.2f} million particle-steps/s and core")
    if not lammps:
        print("kernel: no LAMMPS here (Debian: apt-get install lammps)")
        return
    alone = [1 / (1 / pmb - 1 / contact) for pmb, contact in zip(rates["LAMMPS pmb"], rates["LAMMPS contact"])]
    print(f"kernel: {'LAMMPS pmb without contact search':36s} {statistics.median(alone) / 1e6:6.2f} million particle-steps/s and core")
    for name, values in rates.items():
        if not name.startswith("LAMMPS"):
            theirs = alone if "pmb" in name else rates["LAMMPS lps"]
            ratios = [a / b for a, b in zip(values, theirs)]
            print(f"kernel: {name:36s} {statistics.median(ratios):6.1f} times LAMMPS ({min(ratios):.1f} to {max(ratios):.1f})")


def rates():
    """Print the rates of all kernels of this process as JSON, and what a particle-step costs."""
    import numpy as np

    from pdhpc.peridynamics.internal_forces import InternalForces
    from pdhpc.warm_up import NoGhosts, Variant, block

    calls = {}
    for path in ("lattice", "cloud"):
        for model in ("pmb", "lps"):
            subdomain, law = block(3, SIDE, 3.0, False, path, model, Variant(influence="inverse_distance" if model == "lps" else "constant"))
            particles = subdomain.particles
            particles.put(particles.displacement, 1e-5 * subdomain.places())
            particles.place()
            calls[f"{path} {model}"] = InternalForces(subdomain, law, NoGhosts).evaluate
            calls[f"{path} {model}"]()
    seconds = {name: [] for name in calls}
    for _ in range(7):
        for name, call in calls.items():
            started = time.perf_counter()
            call()
            seconds[name].append(time.perf_counter() - started)
    print(json.dumps({name: SIDE**3 / float(np.median(values)) for name, values in seconds.items()}))


def _worker(words, environment=None, ranks=None):
    """Return what `bench.py words` prints as JSON, in a process of its own or on some ranks."""
    environment = {**os.environ, **(environment or {})}
    command = [sys.executable, __file__, *words]
    if ranks is not None:
        from pdhpc.study.launch import launch_command

        command, environment = launch_command(ranks, [sys.executable, "-m", "mpi4py", __file__, *words])
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"tools/bench: {' '.join(words)} failed:\n{done.stderr[-2000:]}")
    return json.loads(done.stdout.strip().splitlines()[-1])


def _lammps(program, pair):
    """Return particle-steps per second of LAMMPS's pair style alone."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "in").write_text(LAMMPS_INPUT.format(pair=PAIRS[pair], steps=LAMMPS_STEPS, stretch=STRETCH_ALL if pair == "contact" else ""))
        out = subprocess.run([program, "-in", "in", "-log", "none"], cwd=folder, capture_output=True, text=True, check=True).stdout
    seconds = float(re.findall(r"^Pair\s*\|\s*([0-9.e+-]+)", out, re.M)[-1])  # of the last run
    return SIDE**3 * LAMMPS_STEPS / seconds


def run():
    """The time loop of a run (Verlet, exchange, damage, energies every 100 steps) against its bare kernel, and what limits it."""
    for dim, cells, path, steps in ((3, SIDE, "lattice", 300), (3, SIDE, "cloud", 300), (2, 300, "lattice", 1000)):
        results = [_worker(["run-rank", str(dim), str(cells), path, str(steps)]) for _ in range(3)]
        middle = sorted(results, key=lambda result: result["share"])[1]
        print(
            f"run: {dim}D {path}, {middle['particles']:,} particles: {middle['share']:.2f} of the bare kernel ({min(r['share'] for r in results):.2f} to"
            f" {max(r['share'] for r in results):.2f}); {middle['nanoseconds']:.0f} ns, {middle['flops']:.0f} flops and {middle['bytes']:.0f} bytes a particle-step:"
            f" {middle['gflops']:.1f} Gflop/s, {middle['gbytes']:.1f} GB/s of the {middle['stream']:.1f} GB/s that a copy reaches: {middle['limit']}-bound"
        )


def run_rank(dim, cells, path, steps):
    """Time one whole run and its kernel, in turns."""
    import numpy as np

    from pdhpc.scene.read import parse_scene
    from pdhpc.simulation import Simulation

    dim, cells, steps = int(dim), int(cells), int(steps)
    with tempfile.TemporaryDirectory() as folder:
        Simulation(parse_scene(scene_text(dim, 10, path, 100), "block")).run(Path(folder) / "first", quiet=True)  # everything imported and compiled
        simulation = Simulation(parse_scene(scene_text(dim, cells, path, steps), "block"))
        bare = simulation.stepper.internal
        for _ in range(3):
            bare.evaluate()
        started = time.perf_counter()
        for _ in range(30):
            bare.evaluate()
        seconds = (time.perf_counter() - started) / 30
        started = time.perf_counter()
        simulation.run(Path(folder) / "second", quiet=True)
        whole = (time.perf_counter() - started) / steps
        started = time.perf_counter()
        for _ in range(30):
            bare.evaluate()
        seconds = (seconds + (time.perf_counter() - started) / 30) / 2
    subdomain = simulation.problem.subdomain
    particles = subdomain.particles.n_owned
    bonds = subdomain.bonds.n_directed / particles
    moved = {"lattice": dim * 8 * 12 + 8 * -(-int(subdomain.bonds.family_size.max()) // 64), "cloud": dim * 8 * 12 + 12.125 * bonds}[path]
    copied = np.zeros(20_000_000)
    source = np.ones_like(copied)
    started = time.perf_counter()
    np.copyto(copied, source)
    stream = 24 * len(copied) / (time.perf_counter() - started) / 1e9  # read, read for ownership, write
    gbytes = moved * particles / whole / 1e9
    flops = FLOPS[("pmb", dim)] * bonds + 6 * dim
    print(json.dumps({
        "particles": particles, "share": seconds / whole, "nanoseconds": whole / particles * 1e9, "flops": flops, "bytes": moved,
        "gflops": flops * particles / whole / 1e9, "gbytes": gbytes, "stream": stream, "limit": "memory" if gbytes > 0.6 * stream else "compute",
    }))


def scaling():
    """Speed-up from 1 to 2 ranks, launches in turns."""
    for name, dim, cells, path, steps in (
        ("3D lattice, 1e6 particles", 3, 100, "lattice", 20),
        ("2D lattice, 1e6 particles", 2, 1000, "lattice", 60),
        ("3D cloud, 250,047 particles", 3, 63, "cloud", 20),
    ):
        ratios = []
        for _ in range(ROUNDS):
            one, two = (_worker(["steps", str(dim), str(cells), path, str(steps)], ranks=ranks) for ranks in (1, 2))
            ratios.append(one["seconds"] / two["seconds"])
        print(f"scaling: {name}: 1 to 2 ranks {statistics.median(ratios):.2f} times as fast ({min(ratios):.2f} to {max(ratios):.2f}), wait {two['wait']:.1%}")


def steps(dim, cells, path, count):
    """Time some steps on these ranks, after a few to warm up."""
    from mpi4py import MPI

    from pdhpc.scene.build import build
    from pdhpc.scene.read import parse_scene
    from pdhpc.warm_up import compile_kernels

    comm, dim, count = MPI.COMM_WORLD, int(dim), int(count)
    compile_kernels((dim,), (path,), ("pmb",), (False,))
    stepper = build(parse_scene(scene_text(dim, int(cells), path, 100), "block"), comm).stepper()
    for _ in range(3):
        stepper.advance()
    waited = stepper.seconds["wait"]
    comm.Barrier()
    started = time.perf_counter()
    for _ in range(count):
        stepper.advance()
    comm.Barrier()
    seconds = time.perf_counter() - started
    if comm.rank == 0:
        print(json.dumps({"seconds": seconds, "wait": (stepper.seconds["wait"] - waited) / seconds}))


def prediction():
    """The predictor of `pdhpc scale`, calibrated on one size, against runs of three others, on 1 and 2 ranks."""
    from pdhpc.study.predictor import Machine, calibrate, predict

    for dim, sizes in ((2, (500, 250, 700, 1000)), (3, (60, 46, 80, 100))):
        rows = {size: {ranks: [] for ranks in (1, 2)} for size in sizes}
        for _ in range(3):
            for size in sizes:
                for ranks in (1, 2):
                    rows[size][ranks].append(_worker(["row", str(dim), str(size), str(max(10, int(2e7 / size**dim * (3 if dim == 2 else 1))))], ranks=ranks))
        cost, crowding = calibrate([row for found in rows[sizes[0]].values() for row in found], dim, 3.0)
        here = Machine("here", "measured", 2, 1e12, 1e-6, 1e11, 1e-6, 1.0, crowding)
        print(f"prediction: {dim}D, {sizes[0] ** dim:,} particles: {cost.slot * 1e9:.1f} ns a slot, {cost.ghost * 1e9:.0f} ns a ghost, crowding {crowding:.2f}")
        for size in sizes[1:]:
            for ranks in (1, 2):
                measured = statistics.median(row["seconds"] / row["steps"] for row in rows[size][ranks])
                found = predict((size,) * dim, 3.0, ranks, here, cost).seconds
                print(f"prediction: {dim}D, {size**dim:,} particles, {ranks} ranks: {found * 1e3:.3g} ms a step, measured {measured * 1e3:.3g} ({found / measured - 1:+.0%})")


def row(dim, cells, count):
    """One rank of `prediction`: the row of a scaling study."""
    from mpi4py import MPI

    from pdhpc.scene.read import parse_scene
    from pdhpc.study.scaling import Study
    from pdhpc.study.scaling_point import measure

    study = Study(scene="-", kind="strong", ranks=[MPI.COMM_WORLD.size], steps=int(count), warm_up=3, output=False)
    found = measure(study, parse_scene(scene_text(int(dim), int(cells), "lattice", 100), "block"), MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(found))


def setup():
    """Seconds to make particles and bonds on 2 ranks, kernels warm, and the most memory a particle takes, two steps and the energies included."""
    for path, cells in (("cloud", 100), ("lattice", 100), ("lattice", 216)):
        results = [_worker(["setup-rank", path, str(cells)], ranks=2) for _ in range(3 if cells == 100 else 2)]
        times = ", ".join(f"{result['seconds']:.1f}" for result in results)
        print(f"setup: {path}, {results[0]['particles']:,} particles on 2 ranks in {times} s, at most {max(r['bytes'] for r in results):.0f} bytes per particle")


def setup_rank(path, cells):
    """One rank of `setup`."""
    from mpi4py import MPI

    from pdhpc.observers.energies import Energies
    from pdhpc.scene.build import build
    from pdhpc.scene.read import parse_scene
    from pdhpc.warm_up import compile_kernels

    comm = MPI.COMM_WORLD
    compile_kernels((3,), (path,), ("pmb",), (False,))
    build(parse_scene(scene_text(3, 20, path, 100), "block"), comm)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    comm.Barrier()
    started = time.perf_counter()
    problem = build(parse_scene(scene_text(3, int(cells), path, 100), "block"), comm)
    seconds = comm.allreduce(time.perf_counter() - started, op=MPI.MAX)
    stepper = problem.stepper()
    stepper.advance()
    stepper.advance()
    Energies(comm).read(stepper)
    owned = problem.subdomain.particles.n_owned
    peak = comm.allreduce((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 - before) / owned, op=MPI.MAX)
    total = comm.allreduce(owned)
    if comm.rank == 0:
        print(json.dumps({"particles": total, "seconds": seconds, "bytes": peak}))


def coupling():
    """The fractured plate with 250,000 particles: one step everywhere against m steps in the fine region, in time; the interface's share; 1 against 2 ranks."""
    found = {}
    for _ in range(ROUNDS):
        for m, ranks in ((1, 1), (4, 1), (10, 1), (1, 2), (4, 2), (10, 2)):
            found.setdefault((m, ranks), []).append(_worker(["coupling-rank", str(m)], ranks=ranks))
    for m in (4, 10):
        for ranks in (1, 2):
            gains = [single["seconds"] / each["seconds"] for single, each in zip(found[1, ranks], found[m, ranks])]
            shares = [each["share"] for each in found[m, ranks]]
            print(f"coupling: m = {m}, {ranks} rank(s): {_spread(gains)} times one step everywhere, interface {statistics.median(shares):.1%} of the macro step")
        print(f"coupling: m = {m}: {_spread([a['seconds'] / b['seconds'] for a, b in zip(found[m, 1], found[m, 2])])} times as fast on 2 ranks as on 1")


def _spread(values):
    """Return the median and the extremes of some ratios, in words."""
    return f"{statistics.median(values):.2f} ({min(values):.2f} to {max(values):.2f})"


def coupling_rank(m):
    """One rank of `coupling`: seconds of a fine step's worth of time, m = 1: one step everywhere."""
    from mpi4py import MPI

    from pdhpc.scene.build import build
    from pdhpc.scene.read import parse_scene

    comm, m = MPI.COMM_WORLD, int(m)
    text = (ROOT / "runs" / "fractured_plate.toml").read_text()
    method = ["time.method=single"] if m == 1 else [f"fine.step_ratio={m}", "fine.interface=polynomial"]
    stepper = build(parse_scene(text, "plate", ["particles.spacing=2e-4", "particles.horizon=0.603e-3", f"time.dt={3.5e-9 * m}", *method]), comm).stepper()
    for _ in range(3):
        stepper.advance()
    before, steps = dict(stepper.seconds), max(20, 200 // m)
    comm.Barrier()
    started = time.perf_counter()
    for _ in range(steps):
        stepper.advance()
    comm.Barrier()
    seconds = time.perf_counter() - started
    interface = comm.allreduce(stepper.seconds.get("interface", 0.0) - before.get("interface", 0.0), op=MPI.MAX)
    if comm.rank == 0:
        print(json.dumps({"seconds": seconds / steps / m, "share": interface / seconds}))


def energy():
    """E* of two regions over 1e5 macro steps, exact interface solved to 1e-12: the long check that the tests do over 1e4."""
    from pdhpc.parallel.comm import exact_sum, world
    from pdhpc.study.verify.mts import coupled, shake

    for m in (1, 2, 5, 10, 20):
        problem = coupled(m, "exact")
        shake(problem, 1e-3)
        stepper = problem.stepper()
        stepper.operator = problem.regions.operator(stepper.interface, problem.dt, "exact", tolerance=1e-12)
        first = exact_sum(world(), stepper.conserved_quantity())
        for _ in range(100_000):
            stepper.advance()
        print(f"energy: m = {m}: E* changed by {exact_sum(world(), stepper.conserved_quantity()) / first - 1:.1e} over 1e5 macro steps", flush=True)


def fem():
    """Nanoseconds per hexahedron and core of an explicit step on 1 and 2 ranks, by stencils and cell by cell; seconds to assemble and solve 1e5 quads."""
    found = {}
    for _ in range(3):
        for name, side in (("stencil", 100), ("cells", 40)):
            for ranks in (1, 2):
                found.setdefault((name, ranks), []).append(_worker(["fem-steps", name, str(side)], ranks=ranks))
        for ranks in (1, 2):
            found.setdefault(("static", ranks), []).append(_worker(["fem-static"], ranks=ranks))
    for (name, ranks), results in found.items():
        if name == "static":
            parts = ", ".join(f"{part} {statistics.median(each[part] for each in results):.2f} s" for part in ("mesh", "assemble", "solve"))
            total = _spread([each["mesh"] + each["assemble"] + each["solve"] for each in results])
            print(f"fem: {results[0]['cells']} quads, static, {ranks} rank(s): {total} s ({parts}, {results[0]['iterations']} iterations)")
        else:
            print(f"fem: {results[0]['cells']} hexahedra, {name}, {ranks} rank(s): {_spread([each['ns'] for each in results])} ns per cell and core and explicit step")


def fem_steps(name, side):
    """One rank of `fem`: an explicit step of a cube of hexahedra, fastest of five pieces of five steps; "cells" forgets that they are equal."""
    from mpi4py import MPI

    from pdhpc.fem.conditions import NodalConditions
    from pdhpc.fem.explicit import Explicit
    from pdhpc.fem.internal_forces import CellSweep, make_sweep
    from pdhpc.fem.nodes import Nodes
    from pdhpc.parallel.noise import noise
    from pdhpc.study.verify.fem_problems import box_mesh, solid

    comm, counts = MPI.COMM_WORLD, (int(side),) * 3
    mesh = box_mesh(comm, counts, (1.0, 1.0, 1.0))
    if name == "cells":
        mesh.cell_size = None
    body, nodes = solid(mesh), Nodes(mesh)
    nodes.set_mass(body.lumped_mass(nodes.stars))
    nodes.put(nodes.velocity, noise(mesh.vertex_id[: mesh.n_owned], 3))
    sweep = (CellSweep if name == "cells" else make_sweep)(nodes, body.stiffness())
    stepper, seconds = Explicit(nodes, sweep, NodalConditions(nodes), 0.1 / int(side)), []
    for _ in range(6):
        comm.Barrier()
        started = time.perf_counter()
        for _ in range(5):
            stepper.advance()
        comm.Barrier()
        seconds.append((time.perf_counter() - started) / 5)
    if comm.rank == 0:
        print(json.dumps({"cells": mesh.n_global_cells, "ns": min(seconds[1:]) * comm.size / mesh.n_global_cells * 1e9}))


def fem_static():
    """One rank of `fem`: a cantilever of 640 x 160 quads, after a small one that loads the kernels."""
    from mpi4py import MPI

    from pdhpc.conditions.time_functions import Constant
    from pdhpc.fem.conditions import NodalConditions
    from pdhpc.fem.loads import nodal_load, traction_loads
    from pdhpc.fem.nodes import Nodes
    from pdhpc.fem.static import Static
    from pdhpc.fem.supports import Given, prescribe_on_facets
    from pdhpc.study.verify.fem_dynamics import left, right
    from pdhpc.study.verify.fem_problems import box_mesh, solid

    comm = MPI.COMM_WORLD
    for counts in ((8, 2), (640, 160)):
        comm.Barrier()
        times = [time.perf_counter()]
        mesh = box_mesh(comm, counts, (4.0, 1.0))
        body, nodes = solid(mesh), Nodes(mesh, False)
        times.append(time.perf_counter())
        load = nodal_load(nodes, traction_loads(body, *right(mesh), [0.0, 1e-3]), Constant())
        held = prescribe_on_facets(body, nodes, left(mesh), (0, 1), Given([0.0, 0.0], Constant()))
        problem = Static(body, nodes, NodalConditions(nodes, [load], held))
        times.append(time.perf_counter())
        problem.advance()
        comm.Barrier()
        times.append(time.perf_counter())
    if comm.rank == 0:
        parts = {part: b - a for part, a, b in zip(("mesh", "assemble", "solve"), times[:-1], times[1:])}
        print(json.dumps({"cells": mesh.n_global_cells, "iterations": problem.iterations, **parts}))


def startup():
    """Seconds of `pdhpc --help` and of a warm `pdhpc check`."""
    program = ROOT / ".venv" / "bin" / "pdhpc"
    for words in (["--help"], ["check", str(ROOT / "runs" / "glass_branching.toml")]):
        seconds = []
        for _ in range(ROUNDS + 1):
            started = time.perf_counter()
            subprocess.run([program, *words], stdout=subprocess.DEVNULL, check=True)
            seconds.append(time.perf_counter() - started)
        print(f"startup: pdhpc {' '.join(words[:1])}: median {statistics.median(seconds[1:]):.2f} s")


def gfem():
    """A pre-cracked plate 2 x 0.8, H/h = 10: elements with particles where it cracks against particles everywhere, in time, while a tenth of it is active."""
    results = [_worker(["gfem-rank", "5.0", "0.002"], ranks=1) for _ in range(3)]
    last = results[-1]
    print(f"gfem: {_spread([each['gain'] for each in results])} times particles everywhere, {last['share']:.1%} of the particles active on average,"
          f" {_spread([100 * each['around'] for each in results])} % of a step not the particles' own")
    print(f"gfem: error {last['error']:.3f}; half the step moves particles everywhere by {last['half_step']:.3f}, 0.1 % more load by {last['more_load']:.3f};"
          f" broken bonds {last['broken']}")


PARTS = {"kernel": kernel, "run": run, "scaling": scaling, "prediction": prediction, "setup": setup, "startup": startup, "coupling": coupling, "energy": energy, "fem": fem, "gfem": gfem, "contact": lambda: contact(_worker, _spread),
         "checkpoint": lambda: checkpoint(_worker, _spread)}
WORKERS = {"rates": rates, "run-rank": run_rank, "steps": steps, "row": row, "setup-rank": setup_rank, "coupling-rank": coupling_rank, "fem-steps": fem_steps, "fem-static": fem_static, "gfem-rank": gfem_rank, "contact-rank": contact_rank,
           "checkpoint-rank": checkpoint_rank}

if __name__ == "__main__":
    if sys.argv[1:2] and sys.argv[1] in WORKERS:
        WORKERS[sys.argv[1]](*sys.argv[2:])
    else:
        for part in sys.argv[1:] or PARTS:
            if part not in PARTS:
                sys.exit(f"tools/bench: {part} is no benchmark; allowed is {', '.join(PARTS)}")
            PARTS[part]()
