"""What the bodies of a scene amount to, particles, volume and mass, beside the volume that was drawn."""
from typing import NamedTuple, Optional

import numpy as np

from pdhpc.parallel.comm import exact_sums

_FAR = 0.05  # of the drawn volume: how much more or less a body may hold before the run says so
_WHOLE = 1e-6  # of a spacing


class Amount(NamedTuple):
    """A body: number of particles; volume, m^3; mass, kg; drawn_volume, m^3, of its shape, None where holes or a file leave no closed form."""

    name: str
    particles: int
    volume: float
    mass: float
    drawn_volume: Optional[float]


def amounts_of(scene, body, parts, comm):
    """Return [Amount] of the bodies, the same on any number of ranks: particles that two parts hold count once, volumes are exact sums. Collective."""
    count, volumes = np.zeros(len(body.lattices), np.int64), [[] for _ in body.lattices]
    first_ids = [lattice.first_id for lattice in body.lattices[1:]]
    for part in parts:
        particles = part.subdomain.particles
        starts = np.searchsorted(particles.id[: particles.n_owned], first_ids)  # ids ascend
        shares = zip(np.split(particles.owned(particles.volume), starts), np.split(part.counted(), starts))
        for each, (volume, counted) in enumerate(shares):
            volumes[each].append(volume[counted])
            count[each] += len(volumes[each][-1])
    sums = [exact_sums(comm, np.concatenate(values)[None])[0] for values in volumes]
    return [amount(scene, body, each, int(number), volume) for each, (number, volume) in enumerate(zip(comm.allreduce(count), sums))]


def amount(scene, body, number, particles, volume):
    """Return the Amount of the body `number` from its particles and their volume, m^3. Local."""
    table = scene.body[number]
    drawn = None if table.hole else table.measure()
    material = next(each for each in scene.material if each.name == table.material)
    return Amount(table.name, particles, volume, material.density * volume, None if drawn is None else drawn * scene.thickness)


def missed(scene, amounts):
    """Return a sentence for each body that its particles fill with 5 % more or less than was drawn. Local."""
    found = []
    for table, each in zip(scene.body, amounts):
        if each.drawn_volume is not None and abs(each.volume - each.drawn_volume) > _FAR * each.drawn_volume:
            share = each.volume / each.drawn_volume - 1
            found.append(f"body '{each.name}': its {each.particles:,} particles fill {each.volume:.5g} m^3, {abs(share):.1%} {'more' if share > 0 else 'less'} than the "
                         f"{each.drawn_volume:.5g} m^3 of its {table.shape}, for whole cells fill it; {_remedy(table, scene.spacing_of(table))} would keep closer")
    return found


def _remedy(table, spacing):
    """Return what brings the volume of a round body closer to what was drawn."""
    if table.shape == "cylinder" and np.count_nonzero(table.axis()) == 1:
        length = float(np.linalg.norm(table.axis()))
        if abs(length / spacing - round(length / spacing)) > _WHOLE:
            return f"a spacing that divides its length, such as {length / np.ceil(length / spacing):.5g} m,"
    return f"a spacing smaller than {spacing:g} m"
