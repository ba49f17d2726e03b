"""Forces, energies and stresses of a random cloud against independent sums in numpy, and their bits under renumbering."""
import math

import numpy as np
import pytest

from pdhpc.kernels import family, reference, sweeps
from pdhpc.kernels.neighbours import find_bonds
from pdhpc.materials.bond_based import BondBased
from pdhpc.materials.law import Setting
from pdhpc.materials.state_based import LinearSolid

RADIUS = 0.22
MODELS = ("pmb", "lps")


class Cloud:
    """A random cloud with random displacements and some dead bonds."""

    def __init__(self, dim, linear, influence="constant", correction="linear", blocks=1, critical=None, order=None, seed=0, model="pmb", varied=False):
        random = np.random.default_rng(seed)
        n = 300 if dim == 2 else 400
        x, u, volume = random.random((n, dim)), 1e-2 * random.standard_normal((n, dim)), 1e-3 * (1 + (random.random(n) if blocks > 1 or varied else np.zeros(n)))
        block = random.integers(0, blocks, n).astype(np.uint8)
        order = np.arange(n) if order is None else order
        self.ids, self.x, self.u = order.astype(np.int64), x[order], u[order]
        self.volume, self.block = volume[order], block[order]
        self.dim, self.linear, self.third, self.n = dim, linear or None, None if dim == 2 else 2, n
        setting = Setting("plane_stress" if dim == 2 else "3d", 0.2, 1.0, influence, 0.04, correction, linear)
        solids = [BondBased("a", 2.0, 5.0, critical_stretch=critical), BondBased("b", 3.0, 9.0, critical_stretch=critical)]
        if model == "lps":
            solids = [LinearSolid("a", 2.0, 5.0, 2.0, critical_stretch=critical), LinearSolid("b", 3.0, 9.0, 3.0, critical_stretch=critical)]
        self.law = type(solids[0]).law([(solid, True) for solid in solids[:blocks]], setting)
        self.bonds, self.sizes = find_bonds(self.x, self.ids, n, RADIUS)
        width = 2 if dim == 2 else 4
        reference, position = np.zeros((n, width)), np.zeros((n, width))
        reference[:, :dim] = self.x
        position[:, :dim] = self.u if linear else self.x + self.u
        row_block = np.full(n, family.MIXED if blocks > 1 else family.VARIED, np.uint8) if blocks > 1 or varied else self.block.copy()
        self.points = family.PointArrays(reference, position, self.volume, self.block, row_block)
        self.force, self.dissipated, self.rows = np.full((n, dim), np.nan), np.zeros(n), np.arange(n, dtype=np.int32)
        self.state = None if model == "pmb" else np.zeros((n, 2))
        if model == "lps":
            sweeps.weighted_volumes(self.bonds, self.points, self.law, self.rows, self.state)

    def kill(self, share):
        """Break a share of the bonds at both ends, chosen by the ids of the ends."""
        for i in range(self.n):
            for k in range(self.bonds.row_start[i], self.bonds.row_start[i] + self.sizes[i]):
                a, b = sorted((self.ids[i], self.ids[self.bonds.neighbour[k]]))
                if (a * 7919 + b * 104729) % 1000 < 1000 * share:
                    self.bonds.alive[k >> 3] &= np.uint8(255 - (1 << (k & 7)))

    def arguments(self, rows=None):
        """What the sweeps take first; rows (n,) default to all."""
        return self.bonds, self.points, self.law, self.state, self.linear, self.third, self.rows if rows is None else np.array(rows, np.int32)

    def forces(self, module=sweeps, rows=None):
        """Compute forces; return the number of directed bonds broken."""
        broken = 0
        if self.state is not None:
            broken = module.dilatations(*self.arguments(rows), self.dissipated)
        return broken + module.bond_forces(*self.arguments(rows), self.force, self.dissipated)

    def alive(self):
        """Yield (i, j) of the directed bonds alive."""
        for i in range(self.n):
            for k in range(self.bonds.row_start[i], self.bonds.row_start[i + 1]):
                if self.bonds.alive[k >> 3] >> (k & 7) & 1:
                    yield i, int(self.bonds.neighbour[k])

    def pairs(self):
        """Yield (i, j, force vector per volume squared, energy density, xi) of the alive bonds, from the formulas."""
        law, ramp = self.law, self.law.weighting
        omega = {0: lambda r: 1.0, 1: lambda r: ramp.horizon / r, 2: lambda r: math.exp(-((r / ramp.horizon) ** 2))}[ramp.influence]
        for i, j in self.alive():
            xi, eta = self.x[j] - self.x[i], self.u[j] - self.u[i]
            r = np.linalg.norm(xi)
            weight = omega(r) * min(1.0, (ramp.ramp_end - r) * ramp.ramp_slope) * law.micromodulus[self.block[i], self.block[j]]
            if self.linear:
                stretch, direction = xi @ eta / r**2, xi / r
            else:
                stretch, direction = np.linalg.norm(xi + eta) / r - 1, (xi + eta) / np.linalg.norm(xi + eta)
            yield i, j, weight * stretch * direction, 0.5 * weight * stretch**2 * r, xi


CASES = [(dim, linear, influence, correction) for dim in (2, 3) for linear in (False, True)
         for influence, correction in (("constant", "none"), ("constant", "linear"), ("inverse_distance", "linear"), ("gaussian", "none"))]


@pytest.mark.parametrize("dim, linear, influence, correction", CASES)
@pytest.mark.parametrize("blocks, varied", [(1, False), (1, True), (2, False)])
def test_forces_energies_and_stresses_are_the_sums(dim, linear, influence, correction, blocks, varied):
    body = Cloud(dim, linear, influence, correction, blocks, varied=varied)
    body.kill(0.2)
    assert body.forces() == 0
    force, energy, stress = np.zeros((body.n, dim)), np.zeros(body.n), np.zeros((body.n, dim, dim))
    for i, j, pair, micropotential, xi in body.pairs():
        force[i] += pair * body.volume[j]
        energy[i] += 0.5 * micropotential * body.volume[j]
        stress[i] += 0.5 * np.outer(pair, xi) * body.volume[j]
    scale = np.abs(force).max()
    assert np.abs(body.force - force).max() < 1e-12 * scale
    measured = np.empty(body.n)
    sweeps.strain_energy_density(*body.arguments(), measured)
    assert np.allclose(measured, energy, rtol=1e-12, atol=1e-14 * energy.max())
    tensors = np.empty((body.n, dim, dim))
    sweeps.stress(*body.arguments(), tensors)
    assert np.abs(tensors - stress).max() < 1e-12 * np.abs(stress).max()


@pytest.mark.parametrize("dim, linear", [(2, False), (2, True), (3, False), (3, True)])
@pytest.mark.parametrize("blocks", [1, 2])
def test_bonds_break_beyond_the_critical_stretch_at_both_ends(dim, linear, blocks):
    body = Cloud(dim, linear, blocks=blocks, critical=0.05)
    before = set(body.alive())
    broken = body.forces()
    after = set(body.alive())
    for i, j in before:
        xi, eta = body.x[j] - body.x[i], body.u[j] - body.u[i]
        r = np.linalg.norm(xi)
        stretch = xi @ eta / r**2 if linear else np.linalg.norm(xi + eta) / r - 1
        if abs(stretch - 0.05) > 1e-12:
            assert ((i, j) in after) == (stretch < 0.05)
    assert 0 < broken == len(before) - len(after)
    assert all((j, i) in after for i, j in after)
    force = np.zeros((body.n, dim))
    for i, j, pair, _, _ in body.pairs():
        force[i] += pair * body.volume[j]
    assert np.abs(body.force - force).max() < 1e-12 * np.abs(force).max(), "a bond that breaks exerts no force in the same evaluation"
    assert body.forces() == 0


def test_a_broken_bond_dissipates_its_energy_at_the_critical_stretch():
    body = Cloud(2, False, critical=0.05)
    before = set(body.alive())
    body.forces()
    law, ramp, total = body.law, body.law.weighting, 0.0
    for i, j in before - set(body.alive()):
        r = np.linalg.norm(body.x[j] - body.x[i])
        weight = min(1.0, (ramp.ramp_end - r) * ramp.ramp_slope) * law.micromodulus[0, 0]
        total += 0.5 * 0.5 * weight * 0.05**2 * r * body.volume[i] * body.volume[j]
    assert body.dissipated.sum() == pytest.approx(total, rel=1e-12)


@pytest.mark.parametrize("dim, linear, blocks, varied", [(2, False, 1, False), (2, True, 2, False), (3, False, 2, False), (3, True, 1, False), (2, True, 1, True), (3, False, 1, True)])
@pytest.mark.parametrize("model", MODELS)
def test_forces_have_the_same_bits_under_any_numbering(dim, linear, blocks, varied, model):
    plain, shuffled = Cloud(dim, linear, blocks=blocks, critical=0.05, model=model, varied=varied), None
    order = np.random.default_rng(5).permutation(plain.n)
    shuffled = Cloud(dim, linear, blocks=blocks, critical=0.05, order=order, model=model, varied=varied)
    assert plain.forces() == shuffled.forces() > 0
    assert np.array_equal(plain.force[order], shuffled.force)
    assert np.array_equal(plain.dissipated[order], shuffled.dissipated)


@pytest.mark.parametrize("dim, linear, influence, correction", CASES)
@pytest.mark.parametrize("model, varied", [*((model, False) for model in MODELS), ("lps", True)])
def test_eight_at_a_time_agrees_with_bond_by_bond(dim, linear, influence, correction, model, varied):
    eight, one = (Cloud(dim, linear, influence, correction, critical=0.05, model=model, varied=varied) for _ in range(2))
    for body in (eight, one):
        body.kill(0.2)
    broken = eight.forces()
    assert broken == one.forces(reference) > 0
    assert np.array_equal(eight.bonds.alive, one.bonds.alive)
    assert np.array_equal(eight.dissipated, one.dissipated)
    assert np.abs(eight.force - one.force).max() < 1e-12 * np.abs(one.force).max()


@pytest.mark.parametrize("dim, linear", [(2, False), (2, True), (3, False), (3, True)])
@pytest.mark.parametrize("model", MODELS)
def test_forces_depend_on_the_state_alone(dim, linear, model):
    body = Cloud(dim, linear, critical=0.05, model=model)
    assert body.forces() > 0
    while_breaking = body.force.copy()
    assert body.forces() == 0
    assert np.array_equal(body.force, while_breaking), "a restart evaluates without breaking what the first run evaluated while breaking"


def test_rows_can_be_done_in_pieces():
    whole, pieces = (Cloud(3, False, critical=0.05) for _ in range(2))
    pieces.points.row_block[::7] = family.MIXED
    whole.points.row_block[::7] = family.MIXED
    broken = sum(pieces.forces(rows=rows) for rows in (range(150, pieces.n), [], [2, 0, 1], range(3, 150)))
    assert broken == whole.forces()
    assert np.array_equal(pieces.force, whole.force)
    assert np.array_equal(pieces.bonds.alive, whole.bonds.alive)


def test_only_the_rows_asked_for_are_touched():
    body = Cloud(3, False, critical=0.05)
    assert body.forces(rows=[5, 17]) > 0
    assert np.flatnonzero(np.isfinite(body.force[:, 0])).tolist() == [5, 17] and np.flatnonzero(body.dissipated).tolist() == [5, 17]


@pytest.mark.parametrize("dim, linear", [(2, False), (2, True), (3, False), (3, True)])
@pytest.mark.parametrize("model", MODELS)
def test_nan_spreads_along_intact_bonds_and_breaks_none(dim, linear, model):
    body = Cloud(dim, linear, critical=1e3, model=model)  # only a NaN could break a bond
    body.kill(0.5)
    body.points.position[10, 0] = np.nan
    assert body.forces() == 0
    reached = {i for i, j in body.alive() if j == 10} | {10}
    if model == "lps":  # a neighbour's dilatation pulls at its own neighbours
        reached |= {i for i, j in body.alive() if j in reached}
    assert len(reached) > 2
    assert {i for i in range(body.n) if np.isnan(body.force[i]).any()} == reached


def test_deformation_moments_recover_a_gradient():
    body = Cloud(3, True)
    gradient = np.array([[0.1, 0.2, 0.0], [0.0, -0.1, 0.3], [0.05, 0.0, 0.2]])
    body.points.position[:, :3] = body.x @ gradient.T
    shape, moment = np.empty((body.n, 3, 3)), np.empty((body.n, 3, 3))
    sweeps.deformation_moments(body.bonds, body.points, body.law, body.third, body.rows, shape, moment)
    assert np.abs(moment - gradient @ shape).max() < 1e-12 * np.abs(shape).max()


def test_largest_frequency_is_that_of_the_stiffest_row():
    body = Cloud(2, True)
    ramp, tensors = body.law.weighting, np.zeros((body.n, 2, 2))
    for i, j in body.alive():
        xi = body.x[j] - body.x[i]
        r = np.linalg.norm(xi)
        tensors[i] += body.law.micromodulus[0, 0] * min(1.0, (ramp.ramp_end - r) * ramp.ramp_slope) * body.volume[j] / r**3 * np.outer(xi, xi)
    expected = np.abs(tensors).sum(axis=2).max() / body.law.density[0]
    assert sweeps.largest_frequency2(body.bonds, body.points, body.law, None, body.third, body.rows) == pytest.approx(expected, rel=1e-12)
