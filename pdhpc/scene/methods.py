"""The mesh, the finite elements and their coupling with particles as tables of the scene."""
from typing import Literal, Optional

from pdhpc.scene.fields import AutoOrRatio, Flag, Fraction, NotNegative, Positive, Table, Text, Whole, key


class Mesh(Table):
    """Cells that fill the bodies: of a box, or of a file."""

    cell_size: Optional[Positive] = key(
        "side H of square (3D: cubic) cells that fill box-shaped bodies; with particles a whole multiple of their spacing", "m",
        "a family lies within a cell and its neighbours: horizon + spacing/2 <= H with model = \"gfem\"", default=None)
    file: Optional[Text] = key(
        'file of one kind of cells (triangles, quads, tetrahedra or hexahedra) that meshio reads, such as gmsh\'s .msh, named from the folder of the scene; '
        'model = "fem"',
        default=None)
    thickness: Optional[Positive] = key("thickness of a 2D body (default that of [particles], or 1); none in 3D", "m", default=None)


class Fem(Table):
    """How the finite elements take part."""

    integration: Literal["explicit", "newmark", "static"] = key(
        "explicit: central differences with the row-sum lumped mass; newmark: average acceleration, stable at any step; static: equilibrium under the loads at "
        "time.end, in one step", "", "Newmark 1959, beta = 1/4, gamma = 1/2", default="explicit")
    moduli: Optional[Literal["continuum", "lattice"]] = key(
        'continuum: Hooke\'s law of E and nu; lattice: the moduli C_p of the particle lattice\'s own bonds (default: lattice with model = "gfem", else '
        'continuum)', "",
        "C_p = 1/2 sum_q c omega beta V |xi| e(x)e(x)e(x)e", default=None)
    partition_of_unity: Literal["hat", "flat_top"] = key(
        "functions phi_i that carry the displacement: hats times constants (standard elements), or flat-top functions times linear polynomials (boxes, "
        "newmark and static)", "", "Griebel & Schweitzer 2000", default="hat")


class Gfem(Table):
    """How local particles enrich the finite elements."""

    scheme: Literal["pinned", "galerkin", "instant", "literal"] = key(
        "pinned: the enrichment has coefficient 1; galerkin: coefficients are solved for, degrees of freedom chosen; to compare with, instant: the force of "
        "the step's end in the place of its mean, and literal: stress from the gradients of the enrichment", "", "the first is the fastest", default="pinned")
    activation: Optional[Fraction] = key(
        "share theta of the critical stretch: a bond beyond it activates the patches of its cell (default 0.6)", "1", "s > theta s0", default=None)
    tolerance: Optional[NotNegative] = key(
        'residual of the enrichment on a patch above which its degrees of freedom are enriched (default 0.02); none with scheme = "pinned"', "1",
        "||eta - P eta|| / ||eta|| > tolerance", default=None)
    substeps: AutoOrRatio = key('k, steps of the local particles in a global step; "auto": each at most 0.57 of the critical step of particles, so 4 at H/h = 5 and 6 at 10', "1", default="auto")
    everywhere: Flag = key("particles in the whole body from the start", default=False)


class Static(Table):
    """How a body is brought from one equilibrium to the next, with time.method = "relaxation" or "newton"."""

    steps: Optional[Whole] = key("load steps, equal parts of time.end (default: one for each frame)", "1", default=None)
    tolerance: Fraction = key(
        "residual at which a body is in equilibrium", "1", "|V (f + b)|, free components, over the larger of |V b| there and |V (f + b)| of supports, the largest so far",
        default=1e-6)
    iterations: Optional[Whole] = key("most iterations in an equilibrium (default: 100000 of relaxation, 30 of newton)", "1", default=None)
    breaking: Literal["all", "most_strained"] = key(
        "which bonds break in an equilibrium: all beyond their limit, or of them those within 1 % of the largest s/s0; then equilibrium is found again", default="all")
    equilibria: Whole = key("most equilibria in a load step: a body whose bonds break in each of them ends the run", "1", default=500)


ACTIVATION, TOLERANCE = 0.6, 0.02  # unless the scene says otherwise
