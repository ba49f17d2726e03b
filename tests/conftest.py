"""Under MPI only rank 0 reports, and a failure on any rank ends the whole job, since the other ranks would wait for that one for ever."""
import os
import sys
from pathlib import Path

import pytest

MPI_TESTS = Path(__file__).parent / "mpi"


class AbortOnFailure:
    """End the job when a test, the collection or pytest itself fails on this rank, and say so: a report of ranks above 0 would never be printed."""

    def __init__(self, comm):
        self.comm = comm

    def pytest_runtest_logreport(self, report):
        if report.failed:
            self._abort(report.nodeid, report.longreprtext)

    def pytest_collectreport(self, report):
        if report.failed:
            self._abort(report.nodeid, report.longreprtext)

    def pytest_internalerror(self, excrepr):
        self._abort("pytest", excrepr)

    def _abort(self, what, why):
        sys.__stderr__.write(f"\nrank {self.comm.rank} of {self.comm.size}: {what} failed\n{why}\n")
        sys.__stderr__.flush()
        self.comm.Abort(1)


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config):
    """Prepare this rank of an MPI job. A serial run does not even import mpi4py."""
    if not config.getoption("--with-mpi", False):
        return
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    if comm.size > 1:
        config.pluginmanager.register(AbortOnFailure(comm))
    if comm.rank > 0:
        sys.stdout = open(os.devnull, "w")  # the terminal reporter is made after this and writes to what it finds
        config.option.xmlpath = None


def pytest_collection_modifyitems(config, items):
    """Refuse an MPI test that no launch of tools/test would run."""
    if config.getoption("--with-mpi", False):
        return
    for item in items:
        if item.get_closest_marker("mpi") and MPI_TESTS not in item.path.parents:
            raise pytest.UsageError(f"{item.nodeid}: tests marked mpi belong in tests/mpi, elsewhere they are skipped")


@pytest.fixture
def comm():
    """All ranks of an MPI test, or the one of a serial test."""
    from mpi4py import MPI

    return MPI.COMM_WORLD
