"""Jobs in which something goes wrong on purpose: the program with a function of it replaced on some rank."""
import json
import os
import signal
import subprocess
import sys

from pdhpc.study.launch import launch_command

ENDS_WITHIN = 300  # s, kernels that are compiled first included
_BEGIN = "from mpi4py import MPI\nRANK = MPI.COMM_WORLD.rank\n"
_RUN = "\nfrom pdhpc.cli import main\nmain()\n"

AT_STEP = """
from pdhpc.peridynamics.velocity_verlet import VelocityVerlet
def advance(self, once=VelocityVerlet.advance):
    once(self)
    if {when} and self.step == {step}:
        {deed}
VelocityVerlet.advance = advance
"""
"""Does a deed after a step, where `when` holds, such as RANK == 1."""


def command(ranks, patch, *words):
    """Return (command, environment) of `pdhpc words` with the lines of a patch before it."""
    program = [sys.executable, "-c", (_BEGIN + patch + _RUN) if patch else _RUN, *map(str, words)]
    return (program, launch_command(1, program)[1]) if ranks == 1 else launch_command(ranks, program)


def begin(ranks, patch, *words):
    """Start it, in a process group of its own."""
    line, environment = command(ranks, patch, *words)
    return subprocess.Popen(line, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=_hear_sigint)


def _hear_sigint():
    """Shells let what they start in the background ignore it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def end(job):
    """Wait for a job; return (exit code, lines of stderr that are not mpirun's)."""
    try:
        _, said = job.communicate(timeout=ENDS_WITHIN)
    except subprocess.TimeoutExpired:
        os.killpg(job.pid, signal.SIGKILL)
        raise AssertionError(f"the job hangs: {job.communicate()[1]}") from None
    return job.returncode, own_lines(said)


def own_lines(said):
    """Return the lines that are of the program: those before, after and between what mpirun adds in frames of dashes and with its name in brackets."""
    own, inside = [], False
    for line in said.splitlines():
        if line.startswith("-----"):
            inside = not inside
        elif not inside and line.strip() and not line.startswith("["):
            own.append(line)
    return own


def one_sentence(lines):
    """Return the only line there is, which begins with the name of the program."""
    assert len(lines) == 1 and lines[0].startswith("pdhpc: "), lines
    return lines[0]


def record(folder):
    """Return run.json."""
    return json.loads((folder / "run.json").read_text())
