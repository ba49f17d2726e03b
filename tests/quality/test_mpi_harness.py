"""The test harness itself: a failure on one rank must end the job, not hang it, and one rank reports."""
import subprocess
import sys
from pathlib import Path

import pytest

from pdhpc.study.launch import launch_command

CONFTEST = Path(__file__).resolve().parents[1] / "conftest.py"

ONE_RANK_FAILS = """
import pytest

@pytest.mark.mpi(min_size=2)
def test_barrier(comm):
    assert comm.rank != 1
    comm.Barrier()
"""

ONE_RANK_CANNOT_COLLECT = """
import pytest
from mpi4py import MPI

assert MPI.COMM_WORLD.rank != 1

@pytest.mark.mpi(min_size=2)
def test_barrier(comm):
    comm.Barrier()
"""

ALL_PASS = """
import pytest

@pytest.mark.mpi(min_size=2)
def test_barrier(comm):
    comm.Barrier()
"""


def run_on_two_ranks(source, folder):
    """Run a test file under this folder's conftest as tools/test would; hanging for a minute is an error."""
    (folder / "conftest.py").write_text(CONFTEST.read_text())
    (folder / "test_job.py").write_text(source)
    words = [sys.executable, "-m", "mpi4py", "-m", "pytest", "-q", "--with-mpi", "--color=no", "-p", "no:cacheprovider", str(folder)]
    command, environment = launch_command(2, words)
    return subprocess.run(command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize(("source", "failed"), [(ONE_RANK_FAILS, "test_job.py::test_barrier failed"), (ONE_RANK_CANNOT_COLLECT, "test_job.py failed")],
                         ids=["in a test", "in collection"])
def test_failure_on_one_rank_ends_the_job(tmp_path, source, failed):
    done = run_on_two_ranks(source, tmp_path)
    assert done.returncode != 0
    assert f"rank 1 of 2: {failed}" in done.stderr


def test_only_rank_0_reports(tmp_path):
    done = run_on_two_ranks(ALL_PASS, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("1 passed") == 1
