"""The space of the global problem: the standard functions of the mesh, and a field times these where it says what they cannot."""
from typing import NamedTuple

import numpy as np

from pdhpc.gfem import moments as integrals
from pdhpc.gfem.enriched_cells import EnrichedCells
from pdhpc.gfem.enriched_mass import EnrichedMass
from pdhpc.gfem.patch_projection import PatchProjection, set_means, set_norms
from pdhpc.parallel.comm import exact_sum, largest
from pdhpc.parallel.linear_solver import AssembledSolver, Defaults, first_row

_SMALLEST_NORM = 1e-14  # of the largest: an enriched function below it is noise


class Solution(NamedTuple):
    """A field of the enriched space.

    nodes (n_vertices, dim), its coefficients of the standard functions. amplitude (n_vertices, dim), those of phi_i (eta - mean_i), 0 where it is not selected.
    field (n, dim), its values at the points.
    """

    nodes: np.ndarray
    amplitude: np.ndarray
    field: np.ndarray


class EnrichedSpace:
    """span{phi_i} and, for selected vertices i of J and components c, phi_i (eta_c - mean_ic) / norm_ic, mass-weighted mean and norm over the points.

    A function is selected where the patch residual ||eta_c - P_i eta_c||, P_i the projection onto the standard functions of the cells around i, exceeds a
    tolerance relative to eta's root mean square over the enriched cells: were eta_c a standard function there, the mass matrix would be singular.

    Attributes
    ----------
    residual (n_vertices, dim), relative, of owned vertices in J. mean, norm (n_vertices, dim).
    iterations : of the solver so far. failure : None, or what the first solve that failed has to say.
    """

    iterations = 0
    failure = None

    def __init__(self, mesh, tolerance=1e-12, centred=True):
        """mesh : fem.mesh.Mesh. tolerance : of the solver (PETSc prefix gfem_), relative. centred : False leaves out the means. Collective."""
        self._mesh, self._defaults, self._centred = mesh, Defaults("cg", tolerance, 2000), centred
        n, dim = len(mesh.points), mesh.dim
        self._pair = integrals.pairs(mesh.cells.shape[1])
        self._functions, self._coefficients = np.zeros((n, 2 * dim)), np.zeros((n, 2 * dim))
        self.mean, self._inverse_norm = self._functions[:, :dim], self._functions[:, dim:]
        self.norm, self.residual, self._tested = np.zeros((n, dim)), np.zeros((n, dim)), np.zeros((n, dim))
        self._bound = [mesh.exchange.bind(field) for field in (self._functions, self._coefficients, self._tested)]
        self._bound_moments = None

    def update(self, inside, points, lumped):
        """Take over patches that have grown. Collective.

        inside (n_vertices,) bool : J, the same on owners and ghosts; all cells around these vertices have points. points : Points of this rank's own cells.
        lumped (n_vertices,), kg : the mass of everything that has no points, summed to the vertices; used on owned ones.
        """
        mesh, corners, dim = self._mesh, self._mesh.cells.shape[1], self._mesh.dim
        self._points, self._lumped, self._inside = points, lumped, inside
        self.cells = cells = EnrichedCells(mesh, points)
        self._masses = np.zeros((len(cells.corners), self._pair.max() + 1))
        integrals.mass_moments(cells.start, points.shape, points.mass, self._masses)
        bound = cells.exchange.bind(self._masses)
        bound.refresh()
        bound.free()
        self.mass = EnrichedMass(mesh, cells, inside, dim, lambda n: first_row(mesh.comm, n))
        self._projection = PatchProjection(cells.stars, self._pair, self._masses, self.mass.rows_in_stars)
        if self._bound_moments is not None:
            self._bound_moments.free()
        self._moments = np.zeros((len(cells.corners), integrals.width_of_field(corners, dim)))
        self._bound_moments = cells.exchange.bind(self._moments)
        self._cell_mass = integrals.cell_masses(self._pair, self._masses[: cells.n_owned])
        self._solver = AssembledSolver(mesh.comm, "gfem_", self._defaults, self.mass.indptr, self.mass.columns)

    def select(self, eta, tolerance):
        """Enrich by eta (n, dim), the field at the points: choose the functions, and assemble the mass matrix. Collective.

        tolerance : relative patch residual above which a component is enriched; 0 enriches wherever the function is not noise.
        """
        cells, points, chosen = self.cells, self._points, self.mass.enriched
        self._eta = eta
        integrals.field_moments(cells.start, points.shape, points.mass, eta, self._moments)
        self._bound_moments.refresh()
        if self._centred:
            set_means(cells.stars, self._pair, self._masses, self._moments, self.mean)
        set_norms(cells.stars, self._pair, self._masses, self._moments, self.mean, self.norm)
        root = self._root_mean_square()
        self.residual[chosen] = self._projection.residuals(self._moments, self.mean) / (root if root > 0.0 else 1.0)
        noise = _SMALLEST_NORM * largest(self._mesh.comm, float(self.norm[chosen].max(initial=0.0)))
        take = (self.norm[chosen] > noise) & ((self.residual[chosen] > tolerance) | (tolerance == 0.0))
        self._inverse_norm[...] = 0.0
        self._inverse_norm[chosen] = np.where(take, 1.0 / np.where(take, self.norm[chosen], 1.0), 0.0)
        self._bound[0].refresh()
        self.mass.fill(self._pair, self._masses, self._moments, self._lumped, self.mean, self._inverse_norm)
        self._solver.fill(self.mass.values)

    def _root_mean_square(self):
        """Return (sum m |eta|^2 / sum m)^(1/2) over all enriched cells. Collective."""
        comm, n_owned = self._mesh.comm, self.cells.n_owned
        total, squares = exact_sum(comm, self._cell_mass), exact_sum(comm, integrals.squares(self._cell_mass, self._pair, self._moments[:n_owned]))
        return np.sqrt(squares / total) if total > 0.0 else 0.0

    def solve(self, right_nodes, momentum, tested=None):
        """Return the Solution with M x = r. Collective.

        The iteration starts from eta itself, which all functions together reproduce.

        Parameters
        ----------
        right_nodes (n_vertices, dim) : r of the standard functions, summed over all ranks on owned vertices, kg times the field's unit.
        momentum (n, dim) : of this rank's own points, r_i = sum_p momentum_p phi_i (eta - mean_i) of the enriched functions, in the same unit.
        tested (n_vertices, dim) : None, or what this rank adds to these r_i.
        """
        mass, dim = self.mass, self._mesh.dim
        guess = np.concatenate((self.mean[mass.standard].ravel(), np.where(self._inverse_norm > 0.0, self.norm, 0.0)[mass.enriched].ravel()))
        x = self._solver.solve(self._right(right_nodes, momentum, tested), guess)
        self.iterations += self._solver.iterations
        self.failure = self.failure or self._solver.failure
        nodes, amplitude = self._coefficients[:, :dim], self._coefficients[:, dim:]
        n_owned, n_standard = self._mesh.n_owned, dim * len(mass.standard)
        lumped = self._lumped[:n_owned, None]
        nodes[:n_owned] = np.where(lumped > 0.0, right_nodes[:n_owned] / np.where(lumped > 0.0, lumped, 1.0), 0.0)
        nodes[mass.standard] = x[:n_standard].reshape(-1, dim)
        amplitude[...] = 0.0
        amplitude[mass.enriched] = x[n_standard:].reshape(-1, dim) * self._inverse_norm[mass.enriched]
        self._bound[1].refresh()
        field = np.empty_like(self._eta)
        integrals.field_at_points(self.cells.corners, self._at_points(), self.mean, nodes, amplitude, field)
        return Solution(nodes.copy(), amplitude.copy(), field)

    def _right(self, right_nodes, momentum, tested):
        """Return (n_local,), the right side of this rank's rows. Collective over neighbours."""
        self._tested[...] = 0.0 if tested is None else tested
        integrals.add_tested_momentum(self.cells.corners, self._at_points(), momentum, self.mean, self._tested)
        self._bound[2].accumulate()
        enriched = self.mass.enriched
        return np.concatenate((right_nodes[self.mass.standard].ravel(), (self._tested[enriched] * self._inverse_norm[enriched]).ravel()))

    def _at_points(self):
        return self.cells.start, self._points.shape, self._eta, self._moments

    @property
    def selected(self):
        """(n_vertices, dim) bool, owned and ghosts: which functions the field enriches. Local."""
        return self._inverse_norm > 0.0

    @property
    def enriched_functions(self):
        """(dim,) int64, the number of selected functions of this rank's owned vertices. Local."""
        return np.count_nonzero(self.selected[: self._mesh.n_owned], axis=0)

    def condition(self):
        """Return an estimate, from below, of the condition number of the mass matrix scaled by its diagonal; infinite where it is singular. Collective."""
        return self._solver.condition()

    def lost_energy(self, momentum, solution):
        """Return what this rank's whole patches lose of the kinetic energy of momentum (n, dim), kg m/s, in its projection, J. Local."""
        return integrals.lost_energy(self.cells.corners, self.cells.start, self._points.mass, momentum, solution.field, self._inside)
