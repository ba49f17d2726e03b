"""What a scene of particles makes of its bodies that its author may not have meant; nothing here stops a run."""
import numpy as np

from pdhpc.geometry.points import PointBody
from pdhpc.peridynamics.crowding import NEAREST_OTHER, find_close
from pdhpc.scene.amounts import missed
from pdhpc.scene.interactions import half_sizes, sizes_of

_CERTAIN = 0.75  # of the same: no two bodies that touch come near it
_SUSPICIOUS = 0.25  # of the particles that face another body: some cells of a mesh lie nearer than others, whole layers do not


def remarks_on(scene, body, amounts):
    """Return sentences on bodies whose volume is not that of their shape, that no bond joins although they are glued, or that contact lets pass. Local."""
    boxes = np.array([_box_of(lattice) for lattice in body.lattices])
    return [*body.remarks, *missed(scene, amounts)] + _apart(scene, body, boxes) + _passing(scene, body, boxes) + _too_short(scene, body)


def overlaps(scene, body, part, comm):
    """Return a sentence where particles of one body lie suspiciously near those of another, as they do where bodies overlap; bonds in lists alone see it. Collective.

    Raises
    ------
    SceneError, on every rank: most of those that face another body do.
    """
    if len(body.lattices) == 1 or body.lattice is not None:
        return []
    particles = part.subdomain.particles
    size, number = 2 * half_sizes(scene, particles.volume), body.number_of(particles.id)
    close, facing, i, j = find_close(part.subdomain, size, number)
    found = comm.allgather(None if close == 0 else (int(particles.id[i]), int(number[i]), int(number[j])))
    close, facing = (int(count) for count in comm.allreduce(np.array([close, facing])))
    first = min((each for each in found if each is not None), default=None)
    if first is None or close < _SUSPICIOUS * facing:
        return []
    one, other = (scene.body[each].name for each in sorted(first[1:]))
    found = (f"{close:,} of {facing:,} particles that face another body have one of it nearer than {NEAREST_OTHER:g} times the nearest of their own, first of the bodies "
             f"'{one}' and '{other}'")
    if close >= _CERTAIN * facing:
        raise scene.error("body", found, "bodies that do not overlap")
    return [f"{found}: they seem to overlap, and to fill the same space twice"]


def _box_of(lattice):
    """Return (lower, upper), m, of a box that holds the centres of a body's particles."""
    if isinstance(lattice, PointBody):
        return lattice.bounds()
    ends = [lattice.centres(axis)[[0, -1]] for axis in range(len(lattice.cells))]
    return tuple(np.array(ends).T)


def _gaps(boxes, number):
    """Return (n_body,) m: how far the particles of a body are at least from those of each."""
    lower, upper = boxes[:, 0], boxes[:, 1]
    return np.linalg.norm(np.maximum(0.0, np.maximum(lower - upper[number], lower[number] - upper)), axis=1)


def _apart(scene, body, boxes):
    """Return a sentence for each pair of bodies that is glued although no bond reaches from one to the other."""
    names, found = [each.name for each in scene.body], []
    reach = np.broadcast_to(body.reach, (len(names),) * 2)
    for interface in scene.interface:
        one, other = (names.index(name) for name in interface.bodies)
        gap = _gaps(boxes, one)[other]
        if interface.bonds == "glued" and gap > reach[one, other]:
            found.append(f"no bond joins the bodies '{names[one]}' and '{names[other]}', which are to be glued: their particles are at least {gap:.5g} m apart, and "
                         f"bonds between them reach {reach[one, other]:.5g} m")
    return found


def _passing(scene, body, boxes):
    """Return a sentence on the first pair of bodies that moves freely against each other, as nothing but contact, which is not there, would keep them apart.

    Bodies out of each other's reach count only where a velocity is given to a part of the scene at the start: most stay where they are.
    """
    if scene.contact is not None or scene.stands_still or scene.particles.kinematics == "linear":
        return []
    names, reach = [each.name for each in scene.body], np.broadcast_to(body.reach, (len(scene.body),) * 2)
    flies = any(initial.region != "all" and initial.velocity is not None for initial in scene.initial)
    for number, name in enumerate(names[:-1]):
        parted = reach[number] == 0.0
        if flies:
            parted = parted | (_gaps(boxes, number) > reach[number])
        others = np.flatnonzero(parted[number + 1 :])
        if len(others):
            return [f"no bond joins the bodies '{name}' and '{names[number + 1 + others[0]]}', and the scene has no table [contact]: where they meet they pass through each other"]
    return []


def _too_short(scene, body):
    """Return a sentence where the distance of contact lets particles pass between those of a body: half a square's side, half a face's diagonal in 3D."""
    if scene.contact is None or scene.contact.distance == "auto":
        return []
    size = max(largest for _, largest in map(sizes_of, body.lattices))
    least = size / 2 if scene.dim == 2 else size / 2**0.5
    if scene.contact.distance >= least:
        return []
    return [f"contact.distance = {scene.contact.distance:g} m is below {least:.5g} m, half the {'spacing' if scene.dim == 2 else 'diagonal of a face'} of the largest cells: "
            "particles can pass between those of another body without touching one"]
