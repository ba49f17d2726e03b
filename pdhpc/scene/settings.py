"""What a scene leaves to the program, as numbers of run.json: strengths of materials, distance and stiffness of contact, stiffness of impactors."""
import math

from pdhpc.materials.failure import critical_pair_energy
from pdhpc.scene.body import kinds_by_body
from pdhpc.scene.interactions import contact_distance, contact_modulus, penalty, sizes_of


def strengths(body):
    """Return a row for each horizon of the materials of a Body: horizon, m, and critical_stretch, None where bonds never break, or critical_pair_energy, J/m^6."""
    rows = []
    for number, setting in body.kinds:
        material = body.materials[number]
        row = {"name": material.name, "density": material.density, "horizon": setting.horizon}
        if material.failure == "energy":
            row["critical_pair_energy"] = critical_pair_energy(setting, material.energy_release_rate)
        else:
            limit = material.stretch_limit(setting)
            row["critical_stretch"] = limit if math.isfinite(limit) else None
        rows.append(row)
    return rows


def contact_values(scene, body):
    """Return {"distance": m, "stiffness": {material: N/m^6}}, the distance [smallest, largest] where particles differ in size."""
    sizes = [size for lattice in body.lattices for size in sizes_of(lattice)]
    stiffness = {}
    for number, setting in body.kinds:
        material = body.materials[number]
        stiffness.setdefault(material.name, []).append(contact_modulus(scene, material, setting.horizon))
    return {"distance": _range([contact_distance(scene, size) for size in sizes]), "stiffness": {name: _range(values) for name, values in stiffness.items()}}


def impactor_values(scene, body, impactor):
    """Return {material: N/m^4}, the penalty of an impactor on each material, [smallest, largest] where particles of it differ in size."""
    found = {}
    for (number, _), lattice in zip(kinds_by_body(scene), body.lattices):
        material = body.materials[number]
        found.setdefault(material.name, []).extend(penalty(impactor, material, size) for size in sizes_of(lattice))
    return {name: _range(values) for name, values in found.items()}


def _range(values):
    """Return a number, or [smallest, largest] of several ones."""
    return min(values) if min(values) == max(values) else [min(values), max(values)]
