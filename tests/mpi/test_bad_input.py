"""Broken inputs in one job: every rank refuses the same ones, in the same words, and none waits for another."""
import tempfile
from pathlib import Path

import pytest

from tests.faults.broken import try_all


@pytest.mark.mpi(min_size=2)
def test_broken_inputs_are_refused_on_all_ranks(comm):
    if comm.size > 2:
        pytest.skip("two ranks show it")
    with tempfile.TemporaryDirectory() as folder:
        try_all(comm, 100, Path(comm.bcast(folder)))
        comm.Barrier()
