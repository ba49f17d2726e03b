"""The test harness itself: a failure on one rank must end the job, not hang it."""
import subprocess
import sys
from pathlib import Path

from pdhpc.study.verify.launch import launch_command

CONFTEST = Path(__file__).resolve().parents[1] / "conftest.py"
JOB = """
import pytest

@pytest.mark.mpi(min_size=2)
def test_one_rank_fails(comm):
    assert comm.rank != 1
    comm.Barrier()
"""


def test_failure_on_one_rank_ends_the_job(tmp_path):
    (tmp_path / "conftest.py").write_text(CONFTEST.read_text())
    (tmp_path / "test_job.py").write_text(JOB)
    words = [sys.executable, "-m", "mpi4py", "-m", "pytest", "-q", "--with-mpi", "-p", "no:cacheprovider", str(tmp_path)]
    command, environment = launch_command(2, words)
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode != 0
    assert "test_one_rank_fails failed" in done.stderr + done.stdout
