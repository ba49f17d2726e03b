"""Benchmarks of pdhpc: the force kernel against LAMMPS, set-up time and memory, start-up. Called by tools/bench."""
import re
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROUNDS = 5
LAMMPS_STEPS = 10
LAMMPS_INPUT = f"""
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
pair_style peri/pmb
pair_coeff * * 1.6863e22 0.0015001 0.01 0.25
set group all density 2200
set group all volume 1.25e-10
velocity all set 0 0 0 sum no units box
fix 1 all nve
timestep 1.0e-8
velocity all ramp vx -1.0 1.0 x 0 $L units box
run {LAMMPS_STEPS}
"""
CUBE = """
dimension = "3d"
[particles]
spacing = 1e-3
horizon = 3e-3
volume_correction = "none"
[[material]]
name = "glass"
density = 2200
youngs_modulus = 70e9
energy_release_rate = 10
[[body]]
name = "cube"
material = "glass"
shape = "box"
lower = [0.0, 0.0, 0.0]
upper = [0.1, 0.1, 0.1]
[time]
end = 1e-6
"""


def kernel():
    """Particle-steps per second of one core, 97,336 particles with 122 neighbours, and the ratio to LAMMPS peri/pmb on the same block."""
    from pdhpc.kernels.cloud import bond_forces
    from pdhpc.warm_up import block

    subdomain, law = block(3, 46, 3.0)
    particles = subdomain.particles
    particles.displacement[:] = 1e-5 * particles.reference
    particles.place()

    def ours():
        started = time.perf_counter()
        bond_forces(subdomain.points, subdomain.bonds.arrays, law, False, 2, (0, particles.n_owned), particles.force_density, particles.dissipated)
        return particles.n_owned / (time.perf_counter() - started)

    lammps = shutil.which("lmp") or shutil.which("lammps")
    ours()
    rates, theirs = [], []
    for _ in range(ROUNDS):
        rates.append(statistics.median(ours() for _ in range(5)))
        if lammps:
            theirs.append(_lammps(lammps))
    print(f"kernel: {statistics.median(rates) / 1e6:.2f} million particle-steps/s and core ({particles.n_owned} particles, 122 neighbours, finite kinematics)")
    if theirs:
        ratios = [a / b for a, b in zip(rates, theirs)]
        print(f"kernel: LAMMPS peri/pmb {statistics.median(theirs) / 1e6:.3f}; ratio of interleaved runs: median {statistics.median(ratios):.1f}, {min(ratios):.1f} to {max(ratios):.1f}")
    else:
        print("kernel: no LAMMPS here (Debian: apt-get install lammps)")


def _lammps(program):
    """Return particle-steps per second of LAMMPS's pair style alone."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "in").write_text(LAMMPS_INPUT)
        out = subprocess.run([program, "-in", "in", "-log", "none"], cwd=folder, capture_output=True, text=True, check=True).stdout
    seconds = float(re.search(r"^Pair\s*\|\s*([0-9.e+-]+)", out, re.M).group(1))
    return 46**3 * LAMMPS_STEPS / seconds


def setup():
    """Seconds and peak bytes per particle to make a million particles and their bonds on 2 ranks, kernels warm."""
    from pdhpc.study.verify.launch import launch_command

    for repeat in range(3):
        command, environment = launch_command(2, [sys.executable, "-m", "mpi4py", __file__, "setup-rank"])
        print(subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip())


def setup_rank():
    """One rank of `setup`."""
    from mpi4py import MPI

    from pdhpc.scene.build import build
    from pdhpc.scene.read import parse_scene
    from pdhpc.warm_up import compile_kernels

    comm = MPI.COMM_WORLD
    compile_kernels((3,))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    comm.Barrier()
    started = time.perf_counter()
    problem = build(parse_scene(CUBE, "cube", sys.argv[2:]), comm)
    seconds = comm.allreduce(time.perf_counter() - started, op=MPI.MAX)
    owned = problem.subdomain.particles.n_owned
    peak = comm.allreduce((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 - before) / owned, op=MPI.MAX)
    total = comm.allreduce(owned)
    if comm.rank == 0:
        print(f"setup: {total:,} particles on {comm.size} ranks in {seconds:.1f} s, at most {peak:.0f} bytes per particle")


def startup():
    """Seconds of `pdhpc --help` and of a warm `pdhpc check`."""
    root = Path(__file__).resolve().parents[1]
    program = root / ".venv" / "bin" / "pdhpc"
    for words in (["--help"], ["check", str(root / "runs" / "glass_branching.toml")]):
        seconds = []
        for _ in range(ROUNDS + 1):
            started = time.perf_counter()
            subprocess.run([program, *words], stdout=subprocess.DEVNULL, check=True)
            seconds.append(time.perf_counter() - started)
        print(f"startup: pdhpc {' '.join(words[:1])}: median {statistics.median(seconds[1:]):.2f} s")


PARTS = {"kernel": kernel, "setup": setup, "startup": startup}

if __name__ == "__main__":
    if sys.argv[1:2] == ["setup-rank"]:
        setup_rank()
    else:
        for part in sys.argv[1:] or PARTS:
            if part not in PARTS:
                sys.exit(f"tools/bench: {part} is no benchmark; allowed is {', '.join(PARTS)}")
            PARTS[part]()
