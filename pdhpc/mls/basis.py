"""The local fits of moving least squares: polynomials, weight function, normal equations, and which degree these can bear."""
import math
from dataclasses import dataclass

from pdhpc.jit import inlined

PIVOT_OF_DIAGONAL = 1e-4
"""Least share of its diagonal entry that a pivot keeps: below, the particles at hand hardly tell this polynomial from those before it."""
PIVOT_OF_WEIGHT = 5e-5
"""Least share of the sum of weights that a pivot has, coordinates in spacings."""
_HALF_DIAGONAL = {2: 0.71, 3: 0.87}  # spacings from a lattice particle to the farthest point of its cell


@dataclass(frozen=True)
class Basis:
    """Polynomials of a degree up to 2 in `dim` dimensions, fitted under the weight W0(r) = (1 - r^2)^2, r = distance / (radius spacing).

    Raises
    ------
    ValueError: a dimension, degree or radius that there is not.
    """

    dim: int
    degree: int = 1
    radius: float = 2.0  # of the weight function, spacings

    def __post_init__(self):
        if self.dim not in _HALF_DIAGONAL or self.degree not in (0, 1, 2) or not 0.0 < self.radius < math.inf:
            raise ValueError(f"moving least squares takes dim 2 or 3, degree 0, 1 or 2 and a positive radius, not {self.dim}, {self.degree} and {self.radius}")

    @property
    def size(self):
        """Number of polynomials."""
        return math.comb(self.dim + self.degree, self.dim)

    def check_reach(self, spacing, reach):
        """Refuse bonds that reach less far than the weights do: a particle without a bond counts as cut off, and fields would jump in an intact body. Local.

        spacing : m. reach : m, up to which particles have bonds.

        Raises
        ------
        ValueError: (radius + 0.71) spacing, in 3D (radius + 0.87) spacing, exceeds the reach.
        """
        needed = (self.radius + _HALF_DIAGONAL[self.dim]) * spacing
        if not reach >= needed * (1 - 1e-9):
            half = _HALF_DIAGONAL[self.dim]
            raise ValueError(
                f"moving least squares of radius {self.radius:g} needs bonds of up to ({self.radius:g} + {half}) spacings = {needed:g} m, "
                f"but they end at {reach:g} m ({reach / spacing:g} spacings): take a larger horizon"
            )


@inlined
def size_of(dim, degree):
    """Return the number of polynomials of a degree up to 2."""
    if degree == 0:
        return 1
    return 1 + dim if degree == 1 else (dim + 1) * (dim + 2) // 2


@inlined
def polynomials(x, y, z, third, degree, p):
    """Store 1; x, y, (z); x^2, xy, y^2, (xz, yz, z^2), as many as the degree has, in p; third: None in 2D."""
    p[0] = 1.0
    if degree > 0:
        p[1], p[2] = x, y
        if third is not None:
            p[3] = z
    if degree > 1:
        n = 3 if third is None else 4
        p[n], p[n + 1], p[n + 2] = x * x, x * y, y * y
        if third is not None:
            p[n + 3], p[n + 4], p[n + 5] = x * z, y * z, z * z


@inlined
def factorise(a):
    """Replace the lower triangle of a (n, n) by L and D of L D L^T, row by row, up to the first pivot that is too small; return how many are not.

    A pivot d_s is too small below PIVOT_OF_DIAGONAL a_ss or PIVOT_OF_WEIGHT a_00, a_00 the sum of weights. The leading rows are those of the same equations
    of a lower degree.
    """
    total = a[0, 0]
    for s in range(len(a)):
        pivot = a[s, s]
        least = max(PIVOT_OF_DIAGONAL * pivot, PIVOT_OF_WEIGHT * total)
        for t in range(s):
            rest = a[s, t]
            for q in range(t):
                rest -= a[s, q] * a[t, q] * a[q, q]
            a[s, t] = rest / a[t, t]
        for q in range(s):
            pivot -= a[s, q] * a[s, q] * a[q, q]
        if not pivot > least:
            return s
        a[s, s] = pivot
    return len(a)


@inlined
def solve(a, n, b):
    """Replace b (n or more, width) by the solution of the first n equations, a factorised."""
    for c in range(b.shape[1]):
        for s in range(n):
            for t in range(s):
                b[s, c] -= a[s, t] * b[t, c]
        for s in range(n - 1, -1, -1):
            b[s, c] /= a[s, s]
            for t in range(s + 1, n):
                b[s, c] -= a[t, s] * b[t, c]
