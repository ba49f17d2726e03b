"""Degenerate but legal scenes on more ranks than they have particles or cells: ranks that have nothing."""
import shutil
import tempfile
from pathlib import Path

import pytest

from tests.faults.degenerate import CASES, try_case


@pytest.mark.mpi(min_size=4)
@pytest.mark.parametrize("name", [name for name in CASES if "pmb, cloud" not in name and "lps, lattice" not in name])
def test_it_runs_and_goes_on(comm, name):
    folder = Path(comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None))
    try_case(comm, name, folder)
    comm.Barrier()
    if comm.rank == 0:
        shutil.rmtree(folder)
