"""The schemes of a coupled step by name."""
from pdhpc.gfem.enrichment import EnrichedSpace
from pdhpc.gfem.galerkin import Galerkin
from pdhpc.gfem.instant import Instant
from pdhpc.gfem.literal import Literal
from pdhpc.gfem.patch_mass import PatchMass
from pdhpc.gfem.pinned import Pinned

TOLERANCE = 0.02  # of the patch residual
_ENRICHED = {scheme.name: scheme for scheme in (Galerkin, Instant, Literal)}
NAMES = (Pinned.name, *_ENRICHED)


def make_scheme(name, solution, local, steps, tolerance=None):
    """Return the scheme of a name. Collective.

    Parameters
    ----------
    solution : MeshSolution. local : LocalParticles. steps : (dt, k), dt, s, of k sub-steps.
    tolerance : None or the relative patch residual above which a component is enriched (default 0.02); not of "pinned".

    Raises
    ------
    ValueError: no scheme has this name.
    """
    dt, k = steps
    if name == Pinned.name:
        return Pinned(solution, local, PatchMass(solution.mesh.comm, solution.mesh, solution.material), dt, k)
    if name not in _ENRICHED:
        raise ValueError(f'gfem.scheme = "{name}"; allowed is {", ".join(NAMES)}')
    return _ENRICHED[name](solution, local, EnrichedSpace(solution.mesh), dt, k, TOLERANCE if tolerance is None else tolerance)
