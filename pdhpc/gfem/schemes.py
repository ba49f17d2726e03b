"""The schemes of a coupled step by name."""
from pdhpc.gfem.enrichment import EnrichedSpace
from pdhpc.gfem.galerkin import Galerkin
from pdhpc.gfem.instant import Instant
from pdhpc.gfem.literal import Literal
from pdhpc.gfem.pinned import Pinned
from pdhpc.gfem.ramp_mass import RampMass

_ENRICHED = {scheme.name: scheme for scheme in (Galerkin, Instant, Literal)}
NAMES = (Pinned.name, *_ENRICHED)


def make_scheme(name, solution, local, steps, tolerance, refuses=True):
    """Return the scheme of a name. Collective.

    Parameters
    ----------
    solution : MeshSolution. local : LocalParticles. steps : (dt, k), dt, s, of k sub-steps.
    tolerance : relative patch residual above which a component is enriched; "pinned" has none. refuses : whether a comparator fails above its critical step.

    Raises
    ------
    ValueError: no scheme has this name.
    """
    dt, k = steps
    if name == Pinned.name:
        return Pinned(solution, local, RampMass(solution.mesh), dt, k)
    if name not in _ENRICHED:
        raise ValueError(f'gfem.scheme = "{name}"; allowed is {", ".join(NAMES)}')
    scheme = _ENRICHED[name](solution, local, EnrichedSpace(solution.mesh), dt, k, tolerance)
    scheme.refuses = refuses
    return scheme
