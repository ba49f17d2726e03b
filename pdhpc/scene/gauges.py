"""Scene -> what history.csv records: energies, probes, crack tips and fragments."""
from pdhpc.observers.crack_tip import CrackTip
from pdhpc.observers.energies import OF_INTERACTIONS, Energies
from pdhpc.observers.fragments import Fragments
from pdhpc.observers.impactors import ImpactorGauge
from pdhpc.observers.probes import Probe, nearest_point
from pdhpc.parallel.comm import exact_sum

_STRAIN = 1e-10


def make_gauges(problem, view, comm):
    """Return (energies, probes and impactors, tips) of a problem, seen as the stepper's `view`: what history.csv records. Collective."""
    scene, probes = problem.scene, []
    for probe in scene.probe:
        if probe.point is not None:
            members = nearest_point(comm, view, probe.point)
        else:
            members = problem.members(view, comm, probe.region, f"probe '{probe.name}': region")
        supports = problem.supports(comm, probe.region) if probe.quantity == "reaction" else None
        probes.append(Probe(comm, probe.name, probe.quantity, members, scene.dim, supports))
    tips = []
    for tip in scene.tip:
        members = problem.members(view, comm, tip.region, f"tip '{tip.name}': region")
        tips.append(CrackTip(comm, tip, members, view, problem.dt))
    probes += [ImpactorGauge(comm, table.name, scene.dim) for table in scene.impactor]
    held = OF_INTERACTIONS if scene.impactor else OF_INTERACTIONS[:2] if scene.contact is not None else ()
    return Energies(comm, held, _rounding(scene, view, comm)), probes, tips


def _rounding(scene, view, comm):
    """Return E V (1e-10)^2/2, J, of the stiffest material: the energy of strains that are the rounding of positions. Collective."""
    moduli = [each.youngs_modulus or 9 * each.bulk_modulus * each.shear_modulus / (3 * each.bulk_modulus + each.shear_modulus) for each in scene.material]
    return 0.5 * _STRAIN**2 * max(moduli) * exact_sum(comm, view.volume)


def make_fragments(problem, comm):
    """Return the Fragments of a problem of particles, None if its scene does not ask for them. Collective."""
    settings = problem.scene.fragments
    return None if settings is None else Fragments(comm, settings, problem.parts[0], problem.body.law.density)
