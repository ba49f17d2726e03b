import math
import subprocess
import sys

import numpy as np
import pytest

from pdhpc.jit import kernel
from pdhpc.kernels import simd
from pdhpc.kernels.simd import (
    any_of, fma, gather8, gather_xy, gather_xyz, has_bit, lane_mask, lane_sum, larger, load8, lookup8, root8, rsqrt8, rsqrt8_exact, select, splat, sqrt8, store8, words8,
)

A = np.array([1.5, -2.0, 3.25, 0.0, 1e-300, 7.0, -0.5, 4.0])
B = np.array([0.5, 2.0, -1.0, 3.0, 1e300, 7.0, 0.25, -8.0])


@kernel
def _arithmetic(a, b, s, out):
    x, y = load8(a, 0), load8(b, 0)
    store8(out[0], 0, x + y)
    store8(out[1], 0, x - y)
    store8(out[2], 0, x * y)
    store8(out[3], 0, x / y)
    store8(out[4], 0, s * x + 1.0)
    store8(out[5], 0, min(x, y))
    store8(out[6], 0, larger(x, y))
    store8(out[7], 0, sqrt8(x * x))
    store8(out[8], 0, fma(x, y, splat(s)))
    store8(out[9], 0, math.exp(x * 0.1))
    store8(out[10], 0, min(s, x))


def test_arithmetic_is_that_of_numpy():
    out = np.zeros((11, 8))
    _arithmetic(A, B, 2.0, out)
    expected = [A + B, A - B, A * B, A / B, 2.0 * A + 1.0, np.minimum(A, B), np.maximum(A, B), np.sqrt(A * A)]
    for row, values in zip(out, expected):
        assert np.array_equal(row, values)
    assert np.allclose(out[8], A * B + 2.0, rtol=1e-15)
    assert np.allclose(out[9], np.exp(0.1 * A), rtol=1e-15)
    assert np.array_equal(out[10], np.minimum(2.0, A))


@kernel
def _fused(a, b, c):
    return lane_sum(fma(splat(a), splat(b), splat(c))) / 8.0, fma(a, b, c)


def test_fma_rounds_once_for_vectors_and_floats():
    a = 1.0 + 2.0**-30
    vector, scalar = _fused(a, a, -1.0)  # a*a = 1 + 2^-29 + 2^-60, whose last bit a rounded product loses
    assert vector == scalar == 2.0**-29 + 2.0**-60
    assert a * a - 1.0 != scalar


@kernel
def _masks(a, byte, limit, out):
    x = load8(a, 0)
    store8(out, 0, select(lane_mask(byte), x, splat(-1.0)))
    return any_of(x > limit)


def test_masks_and_comparison():
    out = np.zeros(8)
    assert _masks(A, np.uint8(0b10100110), 6.9, out)
    bits = [(0b10100110 >> lane) & 1 for lane in range(8)]
    assert np.array_equal(out, np.where(bits, A, -1.0))
    assert not _masks(A, np.uint8(0), 7.0, out)
    assert not _masks(np.full(8, np.nan), np.uint8(0), 0.0, out)  # NaN is not larger than anything


@kernel
def _sum(a):
    return lane_sum(load8(a, 0))


def test_lane_sum_has_a_fixed_order():
    a = A.copy()
    assert _sum(a) == ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]))


@kernel
def _gather2(table, neighbour, k, out):
    x, y = gather_xy(table, neighbour, k)
    store8(out[0], 0, x)
    store8(out[1], 0, y)


@kernel
def _gather3(table, neighbour, k, out):
    x, y, z = gather_xyz(table, neighbour, k)
    store8(out[0], 0, x)
    store8(out[1], 0, y)
    store8(out[2], 0, z)


@pytest.mark.parametrize("width, gather", [(2, _gather2), (4, _gather3)])
def test_gather_takes_rows_apart(width, gather):
    table = np.random.default_rng(0).random((40, width))
    neighbour = np.random.default_rng(1).integers(0, 40, 24).astype(np.int32)
    out = np.zeros((3, 8))
    gather(table, neighbour, 8, out)
    axes = min(width, 3)
    assert np.array_equal(out[:axes], table[neighbour[8:16], :axes].T)


@kernel
def _gather1(column, neighbour, k, out):
    store8(out, 0, gather8(column, neighbour, k))


def test_gather_of_a_column():
    column, out = np.random.default_rng(0).random(40), np.zeros(8)
    neighbour = np.random.default_rng(1).integers(0, 40, 24).astype(np.int32)
    _gather1(column, neighbour, 8, out)
    assert np.array_equal(out, column[neighbour[8:16]])


@kernel
def _mixed_operands(a, s, out):
    x = load8(a, 0)
    store8(out[0], 0, s - x)
    store8(out[1], 0, x - s)
    store8(out[2], 0, s / x)
    store8(out[3], 0, x / s)
    store8(out[4], 0, s + x)
    store8(out[5], 0, x * s)
    store8(out[6], 0, min(x, s))
    return any_of(s > x), any_of(x > s)


def test_a_float_stands_for_eight_equal_lanes():
    out = np.zeros((7, 8))
    less, more = _mixed_operands(B, 7.0, out)
    expected = [7.0 - B, B - 7.0, 7.0 / B, B / 7.0, 7.0 + B, B * 7.0, np.minimum(B, 7.0)]
    for row, values in zip(out, expected):
        assert np.array_equal(row, values)
    assert less and more


@kernel
def _irrational(a, b, out):
    store8(out[0], 0, sqrt8(load8(a, 0)))
    store8(out[1], 0, load8(a, 0) / load8(b, 0))


def test_roots_and_quotients_are_rounded_as_ieee_says():
    random = np.random.default_rng(4)
    out = np.zeros((2, 8))
    for _ in range(200):
        a, b = random.random(8) * 10.0 ** random.integers(-200, 200), random.random(8)
        _irrational(a, b, out)
        assert np.array_equal(out[0], np.sqrt(a)) and np.array_equal(out[1], a / b)


@kernel
def _inverse_roots(a, out):
    for k in range(0, len(a), 8):
        store8(out[0], k, rsqrt8(load8(a, k)))
        store8(out[1], k, rsqrt8_exact(load8(a, k)))
        store8(out[2], k, root8(load8(a, k)))


def _ulps(found, expected):
    """Distance in units of the last place of `expected`."""
    return np.abs(found - expected) / np.spacing(expected)


def test_inverse_roots_and_roots_are_within_two_ulp_at_all_magnitudes():
    random = np.random.default_rng(5)
    a = np.concatenate([
        random.random(80_000) * 10.0 ** random.uniform(-290, 290, 80_000),
        1.0 + random.uniform(-0.1, 0.1, 80_000),  # measures of bonds
        2.0 ** np.arange(-800, 800, 2), 1.0 + np.arange(-32, 32) * 2.0**-52,
    ])
    out = np.zeros((3, len(a)))
    _inverse_roots(a, out)
    expected = 1.0 / np.sqrt(a)
    assert len(a) % 8 == 0 and np.array_equal(out[1], expected)
    assert _ulps(out[0], expected).max() <= 2.0 and _ulps(out[2], np.sqrt(a)).max() <= 2.0


def test_a_bond_at_rest_has_no_stretch_at_all():
    """1/sqrt(1) and sqrt(1) are exact however they are computed: an undeformed body has forces of exactly zero."""
    out = np.zeros((3, 8))
    _inverse_roots(np.ones(8), out)
    assert np.all(out == 1.0)


def test_inverse_roots_of_nan_are_nan():
    out = np.zeros((3, 8))
    _inverse_roots(np.full(8, np.nan), out)
    assert np.isnan(out).all()


@kernel
def _bits(words, index, bit, out):
    store8(out, 0, select(has_bit(words8(words, index), bit), splat(1.0), splat(0.0)))


def test_bits_of_eight_words():
    words, out = np.random.default_rng(6).integers(0, 2**64, 24, dtype=np.uint64), np.empty(8)
    for index in (0, 3, 8, 16):  # words need not be aligned
        for bit in range(64):
            _bits(words, index, bit, out)
            assert out.tolist() == [float(int(word) >> bit & 1) for word in words[index : index + 8]]


def test_words_of_a_table_are_counted_flat():
    words, out = np.arange(32, dtype=np.uint64).reshape(2, 16), np.empty(8)
    _bits(words, 16 + 4, 0, out)  # the second row from its fifth word on: 20 ... 27
    assert out.tolist() == [0.0, 1.0] * 4


@kernel
def _lookup(table, rows, row, columns, column, out):
    store8(out, 0, lookup8(table, rows, row, columns, column))


@pytest.mark.parametrize("size", (1, 2, 5, 200))
def test_lookups_in_a_table_and_beyond_it(size):
    """An index outside of the table, 255 of a cell without a particle above all, reads row or column 0 instead of what lies behind the table."""
    random = np.random.default_rng(7)
    table = random.random((size, size))
    rows, columns, out = random.integers(0, size, 32).astype(np.uint8), random.integers(0, size, 32).astype(np.uint8), np.empty(8)
    rows[[5, 9]], columns[[11, 12]] = 255, (255, size)
    for row, column in ((0, 0), (3, 7), (8, 8), (24, 17)):
        _lookup(table, rows, row, columns, column, out)
        clipped = [np.where(index < size, index, 0) for index in (rows[row : row + 8], columns[column : column + 8])]
        assert np.array_equal(out, table[clipped[0], clipped[1]])


@kernel
def _nan(a, b, out):
    store8(out[0], 0, larger(load8(a, 0), load8(b, 0)))
    store8(out[1], 0, select(lane_mask(np.uint8(0)), load8(a, 0), load8(b, 0)))


def test_nan_is_neither_taken_over_nor_let_through_a_mask():
    out = np.zeros((2, 8))
    _nan(np.full(8, np.nan), B, out)
    assert np.array_equal(out, [B, B])


@pytest.mark.parametrize("choice", simd.CHOICES)
def test_the_environment_chooses(monkeypatch, choice):
    monkeypatch.setenv("PDHPC_KERNELS", choice)
    assert simd.chosen() == choice


def test_a_misspelt_choice_names_the_right_ones(monkeypatch):
    monkeypatch.setenv("PDHPC_KERNELS", "refrence")
    with pytest.raises(ValueError, match="PDHPC_KERNELS=refrence: must be one of vector, ieee, reference"):
        simd.chosen()


@pytest.mark.parametrize("machine, features, expected", [
    ("x86_64", {"avx2": True, "fma": True}, "vector"),
    ("x86_64", {"avx2": True, "fma": False}, "reference"),
    ("x86_64", {"avx": True}, "reference"),
    ("aarch64", {"neon": True}, "vector"),
])
def test_an_old_vector_unit_is_left_alone(monkeypatch, machine, features, expected):
    monkeypatch.delenv("PDHPC_KERNELS", raising=False)
    monkeypatch.setattr(simd.platform, "machine", lambda: machine)
    monkeypatch.setattr(simd.binding, "get_host_cpu_features", lambda: features)
    assert simd.chosen() == expected


def test_eight_lanes():
    assert simd.LANES == 8


ROOTS = "from pdhpc.kernels import simd; print(simd.rsqrt8 is simd.rsqrt8_exact, simd.root8 is simd.sqrt8, bool(simd.binding.get_host_cpu_features().get('avx512f')))"


@pytest.mark.parametrize("choice", ("vector", "ieee"))
def test_seeds_of_avx_512_are_taken_where_allowed(choice, monkeypatch):
    monkeypatch.setenv("PDHPC_KERNELS", choice)
    done = subprocess.run([sys.executable, "-c", ROOTS], capture_output=True, text=True, check=True)
    exact, plain, able = (word == "True" for word in done.stdout.split())
    assert exact == plain == (choice == "ieee" or not able)
