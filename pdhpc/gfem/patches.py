"""Patches: the vertices J whose surroundings need particles, the cells they reach into, and the ramp over which particles hand over to elements."""
import numpy as np

from pdhpc.jit import kernel


class Patches:
    """Which part of a mesh is enriched. A patch is the support of the function of a vertex, the cells around it; patches are only ever added.

    A rank knows all of it about its own vertices and cells and the layer around them.

    Attributes
    ----------
    chosen : (n_vertices,) bool, the vertices of J. enriched : (n_cells,) bool, cells with a vertex in J: Omega_J. whole : cells with all of theirs in J.
    barred : (n_cells,) bool, cells whose vertices never join J. refused : the most of this rank's vertices that were wanted at once and may not join.
    """

    def __init__(self, mesh, barred):
        """barred : (n_cells,) bool, such as those of prescribed motion; equal on owners and ghosts."""
        self.mesh, self.barred, self.refused = mesh, barred, 0
        n_vertices = len(mesh.points)
        self.chosen = np.zeros(n_vertices, bool)
        self._may_join = np.ones(n_vertices, bool)
        self._may_join[mesh.cells[barred]] = False
        self._marks = np.zeros((n_vertices, 1))
        self._shared = mesh.exchange.bind(self._marks)
        self._share(self._may_join, np.logical_and)
        self._find_cells()

    def _share(self, flags, combine):
        """Combine what all ranks say of each vertex. Collective over neighbours."""
        fails = combine is np.logical_and
        self._marks[:, 0] = ~flags if fails else flags
        self._shared.accumulate()
        self._shared.refresh()
        flags[:] = self._marks[:, 0] == 0.0 if fails else self._marks[:, 0] > 0.0

    def _find_cells(self):
        inside = self.chosen[self.mesh.cells]
        self.enriched, self.whole = inside.any(axis=1), inside.all(axis=1)

    def add(self, cells, first=False):
        """Choose all vertices of the marked owned cells (n_owned_cells,) bool, but those of barred cells; return how many this rank's owned vertices are new.

        Collective over neighbours.
        """
        mesh = self.mesh
        wanted = np.zeros(len(mesh.points), bool)
        wanted[mesh.cells[: mesh.n_owned_cells][cells]] = True
        self._share(wanted, np.logical_or)
        self.refused = max(self.refused, int((wanted & ~self._may_join)[: mesh.n_owned].sum()))
        wanted &= self._may_join & ~self.chosen
        self.chosen |= wanted
        self._find_cells()
        return int(wanted[: mesh.n_owned].sum())

    def never_whole(self):
        """Return (n_cells,) bool, cells with a vertex that never joins J: particles in them share their bonds with elements, which do not break. Local."""
        return ~self._may_join[self.mesh.cells].all(axis=1)

    def restore(self, chosen):
        """Take J of owned vertices (n_owned,) bool as it was stored. Collective over neighbours."""
        self.chosen[:] = False
        self.chosen[: self.mesh.n_owned] = chosen
        self._share(self.chosen, np.logical_or)
        self._find_cells()

    def touched(self, cells):
        """Return (n_vertices,) bool, the vertices of marked cells (n_cells,) bool. Local: complete for the vertices of owned cells."""
        vertices = np.zeros(len(self.mesh.points), bool)
        vertices[self.mesh.cells[cells]] = True
        return vertices

    def around(self, cells):
        """Return (n_cells,) bool: marked cells and all that share a vertex with one. Local: complete for owned cells."""
        return self.touched(cells)[self.mesh.cells].any(axis=1)


@kernel
def largest_principal_strains(cells, chosen, gradient, displacement, result):
    """Store the largest principal strain of a displacement at some points of each chosen cell in result (n,).

    cells (n_cells, corners); chosen (n,) int32, cells; gradient (n_points, corners, 2), 1/m, of the functions at these points; displacement (n_vertices, 2), m.
    No bond inside the cell is stretched beyond it: in linear kinematics a bond's stretch is e . eps e, averaged along it.
    """
    for n in range(len(chosen)):
        largest = -np.inf
        corner = cells[chosen[n]]
        for p in range(len(gradient)):
            xx, yy, xy = 0.0, 0.0, 0.0
            for a in range(gradient.shape[1]):
                gx, gy, i = gradient[p, a, 0], gradient[p, a, 1], corner[a]
                xx += gx * displacement[i, 0]
                yy += gy * displacement[i, 1]
                xy += 0.5 * (gx * displacement[i, 1] + gy * displacement[i, 0])
            largest = max(largest, 0.5 * (xx + yy) + np.sqrt(0.25 * (xx - yy) ** 2 + xy * xy))
        result[n] = largest
