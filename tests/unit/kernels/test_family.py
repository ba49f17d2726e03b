"""What both storages of bonds answer about the same body."""
import itertools

import numpy as np
import pytest

from pdhpc.jit import kernel
from pdhpc.kernels import family, sweeps  # noqa: F401  (sweeps fills the functions of family in)
from pdhpc.kernels.shared import share_bonds
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.warm_up import PATHS


@kernel
def _ask(bonds, points, third, slots, place, rows, first_and_end):
    """Store what the functions of family say of the bonds of `slots`, one row each; return (rows, width of a row of particles)."""
    count = 0
    for n in range(len(slots)):
        i = slots[n]
        place[n, 0], place[n, 1], place[n, 2] = family.place(bonds, points, i)
        first_and_end[n, 0], first_and_end[n, 1] = family.first_bond(bonds, i), family.end_of_bonds(bonds, i)
        for k in range(family.first_bond(bonds, i), family.end_of_bonds(bonds, i)):
            if family.is_alive(bonds, i, k):
                j = family.neighbour(bonds, i, k)
                rows[count, 0], rows[count, 1], rows[count, 2] = i, j, family.inverse_length(bonds, i, k)
                rows[count, 3], rows[count, 4], rows[count, 5] = family.reference_vector(bonds, points, i, j, k, third)
                rows[count, 6] = family.share(bonds, i, k)
                count += 1
    return count, family.row_width(bonds)


@kernel
def _break_every_third(bonds, slots):
    total = 0
    for n in range(len(slots)):
        i, alive = slots[n], 0
        for k in range(family.first_bond(bonds, i), family.end_of_bonds(bonds, i)):
            if family.is_alive(bonds, i, k):
                alive += 1
                if alive % 3 == 0:
                    family.break_bond(bonds, i, k)
                    total += 1
    return total


def answers(subdomain, bonds=None):
    """Return (places, [(row, other row, 1/|xi|, xi, share)] in the order of the bonds, row width)."""
    particles = subdomain.particles
    place, bounds = np.empty((particles.n_owned, 3)), np.empty((particles.n_owned, 2), np.int64)
    rows = np.empty((subdomain.bonds.n_directed, 7))
    count, width = _ask(subdomain.bonds.arrays if bonds is None else bonds, subdomain.points, particles.third, particles.slots, place, rows, bounds)
    row_of = np.full(len(particles.position), -1)
    row_of[particles.slots] = np.arange(particles.n_owned)
    rows = rows[:count]
    rows[:, 0], rows[:, 1] = row_of[rows[:, 0].astype(int)], row_of[rows[:, 1].astype(int)]
    assert np.all(bounds[:, 1] - bounds[:, 0] >= subdomain.bonds.family_size)
    return place, rows, width


def disk(path, dim):
    text = plate((12, 9) if dim == 2 else (6, 5, 7), 3.0 if dim == 3 else 4.0, dimension="3d" if dim == 3 else "plane_stress")
    hole = '[[body.hole]]\nshape = "box"\nlower = [-1.0, -1.0]\nupper = [2.0, 1.0]\n' if dim == 2 else ""
    return problem_of(text.replace("[time]", hole + "[time]"), [f"particles.path={path}"]).subdomain


@pytest.mark.parametrize("path, dim", list(itertools.product(PATHS, (2, 3))))
def test_bonds_are_those_of_the_places(path, dim):
    subdomain = disk(path, dim)
    place, rows, width = answers(subdomain)
    x = subdomain.places()
    assert np.array_equal(place[:, :dim], x) and (dim == 3 or np.all(place[:, 2] == 0.0))
    i, j = rows[:, 0].astype(int), rows[:, 1].astype(int)
    xi = x[j] - x[i]
    assert np.allclose(rows[:, 3 : 3 + dim], xi, atol=1e-14) and (dim == 3 or np.all(rows[:, 5] == 0.0))
    assert np.allclose(rows[:, 2], 1 / np.linalg.norm(xi, axis=1), rtol=1e-14) and np.all(rows[:, 6] == 1.0)
    assert np.array_equal(np.bincount(i, minlength=len(x)), subdomain.bonds.family_size)
    radius = (3.0 if dim == 3 else 4.0) + 0.5
    assert all((np.linalg.norm(x - at, axis=1) < radius - 1e-6).sum() - 1 == size for at, size in zip(x, subdomain.bonds.family_size))
    assert np.all((np.diff(j) > 0) | (np.diff(i) > 0)), "in ascending id"
    assert width == (8 if path == "lattice" else 1)


@pytest.mark.parametrize("dim", (2, 3))
def test_both_storages_hold_the_same_bonds_in_the_same_order(dim):
    (_, lattice, _), (_, cloud, _) = (answers(disk(path, dim)) for path in PATHS)
    assert np.array_equal(lattice[:, :2], cloud[:, :2]) and np.allclose(lattice, cloud, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("path, dim", list(itertools.product(PATHS, (2, 3))))
def test_breaking_takes_one_bond_at_a_time(path, dim):
    subdomain = disk(path, dim)
    _, before, _ = answers(subdomain)
    broken = _break_every_third(subdomain.bonds.arrays, subdomain.particles.slots)
    _, after, _ = answers(subdomain)
    keep = np.concatenate([np.arange(1, size + 1) % 3 > 0 for size in subdomain.bonds.family_size])
    assert broken == np.sum(~keep) and np.array_equal(after, before[keep])
    assert np.array_equal(subdomain.bonds.alive(), np.bincount(before[keep, 0].astype(int)))


@pytest.mark.parametrize("path", PATHS)
def test_weighted_bonds_answer_as_the_bonds_they_wrap(path):
    subdomain = disk(path, 2)
    _, plain, plain_width = answers(subdomain)
    shares = share_bonds(subdomain.bonds.arrays, len(subdomain.particles.position), np.concatenate(subdomain.rows))
    shares.weight[:] = 0.25
    _, weighted, width = answers(subdomain, shares)
    assert np.array_equal(weighted[:, :6], plain[:, :6]) and np.all(weighted[:, 6] == 0.25) and width == plain_width
    broken = _break_every_third(shares, subdomain.particles.slots)
    assert broken > 0 and len(answers(subdomain)[1]) == len(plain) - broken
