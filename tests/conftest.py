"""Under MPI: only rank 0 reports, and a test that fails on any rank ends the whole job, since the other ranks would wait for it for ever."""
import os
import sys

import pytest


def _comm():
    mpi = sys.modules.get("mpi4py.MPI")
    return mpi.COMM_WORLD if mpi is not None else None


@pytest.hookimpl(trylast=True)
def pytest_configure(config):
    """Let ranks above 0 say nothing."""
    comm = _comm()
    if comm is not None and comm.rank > 0:
        reporter = config.pluginmanager.get_plugin("terminalreporter")
        if reporter is not None:
            reporter._tw._file = open(os.devnull, "w")
        config.option.xmlpath = None


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    """Abort all ranks when a test fails on this one."""
    outcome = yield
    report = outcome.get_result()
    comm = _comm()
    if report.failed and comm is not None and comm.size > 1:
        sys.__stderr__.write(f"\nrank {comm.rank} of {comm.size}: {item.nodeid} failed\n{report.longreprtext}\n")
        sys.__stderr__.flush()
        comm.Abort(1)


@pytest.fixture
def comm():
    """All ranks of an MPI test, or the one of a serial test."""
    from mpi4py import MPI

    return MPI.COMM_WORLD
