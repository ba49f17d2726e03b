"""Degenerate but legal scenes in this process; on more ranks than they have particles: tests/mpi/test_degenerate.py."""
import pytest

from tests.faults.degenerate import CASES, try_case


@pytest.mark.parametrize("name", CASES)
def test_it_runs_and_goes_on(comm, tmp_path, name):
    try_case(comm, name, tmp_path)
