"""What tests of many modules look at: the bonds of a subdomain, whichever way they are stored."""
import numpy as np
import pytest


def _intact_pairs(subdomain):
    """Return {(i, j)}, owned rows of the ends of every intact directed bond of a body that one process holds."""
    particles, arrays = subdomain.particles, subdomain.bonds.arrays
    if not hasattr(arrays, "offset"):
        bits = np.unpackbits(arrays.alive, bitorder="little").astype(bool)
        rows = np.repeat(np.arange(particles.n_owned), np.diff(arrays.row_start))
        return set(zip(rows[bits].tolist(), arrays.neighbour[bits].tolist()))
    row_of, found = np.full(len(particles.position), -1), set()
    row_of[particles.slots] = np.arange(particles.n_owned)
    for k, offset in enumerate(arrays.offset):
        bits = arrays.alive[k // 64, particles.slots] >> np.uint64(k % 64) & np.uint64(1)
        rows = np.flatnonzero(bits)
        found.update(zip(rows.tolist(), row_of[particles.slots[rows] + offset].tolist()))
    return found


def _lose_bonds(subdomain, row):
    """Break all bonds of an owned particle, at its end only."""
    arrays = subdomain.bonds.arrays
    if hasattr(arrays, "offset"):
        arrays.alive[:, subdomain.particles.slots[row]] = 0
    else:
        arrays.alive[arrays.row_start[row] >> 3 : arrays.row_start[row + 1] >> 3] = 0


@pytest.fixture
def intact_pairs():
    """Function subdomain -> {(i, j)} of intact directed bonds, by owned row."""
    return _intact_pairs


@pytest.fixture
def lose_bonds():
    """Function (subdomain, row) that breaks all bonds of an owned particle, at its end only."""
    return _lose_bonds


CRACK = '[[crack]]\ntype = "polyline"\npoints = [[-{half}, 0.0], [{tip}, 0.0]]\n'


def _coupled_text(cells=(24, 16), extra="", material="", tip=-4.0, scheme="pinned"):
    """Return the text of a plate of elements and particles of E = rho = 1: spacing 1, horizon 3, cells of 4, centred on 0.

    tip : a crack lies along y = 0 from the left edge to x = tip, or there is None.
    """
    from pdhpc.study.verify.case import plate

    crack = "" if tip is None else CRACK.format(half=cells[0] / 2 + 1, tip=tip)
    text = plate(cells, extra=f'[mesh]\ncell_size = 4.0\n[gfem]\nscheme = "{scheme}"\n{crack}{extra}', material=material)
    return 'model = "gfem"\n' + text


@pytest.fixture
def coupled_body_text():
    """Function -> the text of a scene of a coupled plate, see _coupled_text."""
    return _coupled_text


@pytest.fixture
def coupled_body():
    """Function (overrides, **options of _coupled_text) -> the CoupledProblem of that plate in this process alone."""
    from pdhpc.study.verify.case import problem_of

    def make(overrides=(), **options):
        return problem_of(_coupled_text(**options), list(overrides))

    return make


@pytest.fixture
def shake():
    """Function (stepper, size) -> the stepper, its vertices displaced and moving as smooth fields of that size, its particles as these are interpolated."""
    return _shake


def _shake(stepper, size):
    solution, local = stepper.solution, stepper.local
    lattice, particles, mesh = local.lattice, local.subdomain.particles, solution.mesh
    x = mesh.points
    solution.displacement[:] = size * np.stack([np.sin(0.3 * x[:, 0] + 0.2 * x[:, 1]), np.cos(0.25 * x[:, 0] - 0.35 * x[:, 1])], axis=1)
    solution.velocity[:] = size * np.stack([np.cos(0.2 * x[:, 1] + 0.1), np.sin(0.3 * x[:, 0] - 0.4)], axis=1)
    slots, cells, numbers = local.slots_of(np.flatnonzero(local.enriched))
    for nodal, field in ((solution.displacement, particles.position), (solution.velocity, particles.velocity)):
        field[slots] = np.einsum("pa,pad->pd", lattice.shape[numbers], nodal[mesh.cells[cells]])
    for name in ("displacement", "velocity"):
        nodal = getattr(solution, name)
        nodal[stepper.patches.chosen] = 0.0
    stepper.scheme.settle()
    solution.evaluate(stepper.time)
    return stepper
