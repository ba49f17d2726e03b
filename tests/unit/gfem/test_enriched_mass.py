import numpy as np

from pdhpc.gfem.enriched_cells import EnrichedCells
from pdhpc.gfem.enriched_mass import EnrichedMass
from pdhpc.gfem.enrichment import EnrichedSpace


def test_rows_and_columns(comm, cracked_box):
    """One vertex of J among 9: each row has its standard neighbours, then the enriched one of its own component."""
    case = cracked_box(comm, (4, 4), inside=lambda x: (x == 2.0).all(axis=1))
    mass = EnrichedMass(case.mesh, EnrichedCells(case.mesh, case.points), case.inside, 2, lambda n: 100)
    assert mass.n_local == 20 and len(mass.standard) == 9 and np.array_equal(mass.standard[4:5], mass.enriched)
    width = np.diff(mass.indptr)
    assert width.tolist() == np.repeat([5, 7, 5, 7, 10, 7, 5, 7, 5], 2).tolist() + [10, 10]
    assert mass.columns[: 5].tolist() == [100, 102, 106, 108, 118]
    assert mass.columns[-10:].tolist() == list(range(101, 119, 2)) + [119]


def test_left_out_functions_have_rows_of_their_own(comm, cracked_box):
    """Symmetric bit for bit; a 1 on the diagonal, and zeros, for what is not selected."""
    case = cracked_box(comm)
    space = EnrichedSpace(case.mesh)
    space.update(case.inside, case.points, case.lumped)
    space.select(case.eta, 0.1)
    mass = space.mass
    matrix = np.zeros((mass.n_local, mass.n_local))
    matrix[np.repeat(np.arange(mass.n_local), np.diff(mass.indptr)), mass.columns] = mass.values
    assert np.array_equal(matrix, matrix.T)
    out = np.flatnonzero(~space.selected[mass.enriched].ravel()) + 2 * len(mass.standard)
    assert len(out) > 0 and np.array_equal(matrix[out], np.eye(mass.n_local)[out])
    total = matrix[: 2 * len(mass.standard), : 2 * len(mass.standard)].sum() / 2
    assert abs(total - case.points.mass.sum() - case.lumped[mass.standard].sum()) < 1e-12
