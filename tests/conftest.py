"""Under MPI only rank 0 reports, and a failure on any rank ends the whole job, since the other ranks would wait for that one for ever."""
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
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


@pytest.fixture
def cracked_box():
    """Function that makes a box of cells with points of uneven masses, enriched around a crack along y = 1.6 for x < 3.2, see _cracked_box."""
    return _cracked_box


def _cracked_box(comm, counts=(6, 4), ratio=4, inside=None):
    """Return a namespace of a mesh of unit cells and what an enriched space takes: mesh, inside (J), points, lumped, position of the points, their field eta.

    inside : function points (n, dim) -> (n,) bool, the vertices of J; default those near the crack. ratio : points along a side of a cell.
    """
    from pdhpc.fem.facets import UNIT_CORNERS
    from pdhpc.fem.mesh import cell_partition, make_box_mesh
    from pdhpc.gfem.points import Points

    dim = len(counts)
    lower, upper = np.zeros(dim), np.array(counts, float)
    mesh = make_box_mesh(comm, lower, upper, counts, cell_partition(comm, lower, upper, counts))
    inside = inside or (lambda x: (np.abs(x[:, 1] - 1.6) < 1.0) & (x[:, 0] < 4.0))
    chosen = inside(mesh.points)
    cell = np.flatnonzero(chosen[mesh.cells[: mesh.n_owned_cells]].any(axis=1)).astype(np.int32)
    template = (np.stack(np.meshgrid(*[np.arange(ratio)] * dim, indexing="ij"), axis=-1).reshape(-1, dim) + 0.5) / ratio
    values = np.prod(np.where(UNIT_CORNERS[mesh.kind][None], template[:, None], 1.0 - template[:, None]), axis=2)
    position = (mesh.points[mesh.cells[cell, 0]][:, None] + template).reshape(-1, dim)
    mass = (1.0 + 0.3 * np.sin(5.0 * position.sum(axis=1))) / ratio**dim
    points = Points(np.arange(len(position)), cell, np.arange(len(cell) + 1) * len(template), np.tile(values, (len(cell), 1)), mass)
    outside = ~chosen[mesh.cells[: mesh.n_owned_cells]].any(axis=1)
    lumped = np.zeros(len(mesh.points))
    np.add.at(lumped, mesh.cells[: mesh.n_owned_cells][outside], 1.0 / mesh.cells.shape[1])
    bound = mesh.exchange.bind(lumped)
    bound.accumulate()
    bound.refresh()
    bound.free()
    x, y = position[:, 0], position[:, 1]
    opening = np.where(x < 3.2, np.sqrt(np.abs(3.2 - x)), 0.0) * np.sign(y - 1.6)
    eta = np.zeros((len(position), dim))
    eta[:, 0], eta[:, 1] = 0.02 * np.sin(x) + 0.1 * opening, 0.05 * x * x + opening
    return SimpleNamespace(mesh=mesh, inside=chosen, points=points, lumped=lumped, position=position, eta=eta)


@pytest.fixture
def pulled_plate():
    """Function that makes a small plate with a crack, coupled by a scheme, see _pulled_plate."""
    return _pulled_plate


_PLATE = """
dimension = "plane_stress"
model = "gfem"
[particles]
spacing = 1.0
horizon = 3.015
kinematics = "linear"
[[material]]
name = "solid"
density = 1.0
youngs_modulus = 1.0
critical_stretch = 0.02
[[body]]
name = "body"
material = "solid"
shape = "box"
lower = [-30.0, -15.0]
upper = [30.0, 15.0]
[[crack]]
type = "polyline"
points = [[-31.0, 0.0], [-16.0, 0.0]]
[[region]]
name = "top"
shape = "box"
lower = [-30.0, 14.0]
upper = [30.0, 15.0]
[[load]]
type = "traction"
region = "top"
face = "+y"
value = [0.001, 0.008]
[damage]
no_fail = ["top"]
[mesh]
cell_size = 5.0
[time]
end = 1.0
"""


def _pulled_plate(comm, scheme, tolerance=0.02, steps=(3.0, 4), everywhere=False):
    """Return (CoupledParts, CoupledStep) of a plate of 60 x 30 particles of mass 1 in cells of 5 x 5, which its top edge pulls upwards.

    scheme : by name, tolerance : of the patch residual; steps : (dt, k); comparators do not refuse their step.
    """
    from pdhpc.gfem.coupled_step import CoupledStep
    from pdhpc.gfem.schemes import make_scheme
    from pdhpc.scene.coupled import CoupledParts
    from pdhpc.scene.read import parse_scene

    parts = CoupledParts(parse_scene(_PLATE + f"[gfem]\neverywhere = {str(everywhere).lower()}\n", "test scene"), comm)
    parts.stepper(*steps)  # chooses the patches
    stepper = CoupledStep(comm, parts.patches, parts.local, parts.solution, make_scheme(scheme, parts.solution, parts.local, steps, tolerance, False), 0.6)
    stepper.follow()
    return parts, stepper
