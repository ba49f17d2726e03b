"""The scene of a thin metal plate that a ball petals, at reduced size."""
import tempfile
from pathlib import Path

import numpy as np

from pdhpc.output.fields import read_frame, read_points
from pdhpc.scene.read import read_scene
from pdhpc.study.verify.case import Check, alone, at_most, case

SCENE = Path(__file__).resolve().parents[3] / "runs" / "petaling.toml"
COARSE = [
    "particles.spacing=0.75e-3", "particles.horizon=2.25e-3", "body.plate.lower=[-36e-3,-36e-3,0.0]", "body.plate.upper=[36e-3,36e-3,2.25e-3]",
    *(f"region.{name}.{end}={place}" for name, lower, upper in (
        ("left", "[-37e-3,-37e-3,-1e-3]", "[-33.75e-3,37e-3,4e-3]"), ("right", "[33.75e-3,-37e-3,-1e-3]", "[37e-3,37e-3,4e-3]"),
        ("front", "[-33.75e-3,-37e-3,-1e-3]", "[33.75e-3,-33.75e-3,4e-3]"), ("back", "[-33.75e-3,33.75e-3,-1e-3]", "[33.75e-3,37e-3,4e-3]"))
      for end, place in (("lower", lower), ("upper", upper))),
    "impactor.ball.center=[0.0,0.0,7.5e-3]", "time.end=90e-6", "output.frames=1", "output.pictures=false",
]


def rays(place, damage, radius, spacing, threshold=0.35):
    """Return the angles, degrees, of the cracks that cross a circle around the middle: means of groups of damaged particles within a spacing of it, 2.5 apart.

    place : (n, 2), m.
    """
    r = np.linalg.norm(place, axis=1)
    on = (np.abs(r - radius) < spacing) & (damage > threshold)
    angle = np.sort(np.degrees(np.arctan2(place[on, 1], place[on, 0])))
    if len(angle) == 0:
        return []
    gap, apart = np.diff(np.append(angle, angle[0] + 360.0)), np.degrees(2.5 * spacing / radius)
    angle = np.roll(angle, -1 - int(np.argmax(gap)))  # begin behind the widest gap
    angle = np.where(angle < angle[0], angle + 360.0, angle)
    means = [float(group.mean()) for group in np.split(angle, np.flatnonzero(np.diff(angle) > apart) + 1)]
    return [mean - 360.0 if mean > 180.5 else mean for mean in means]


def _apart(found, turned):
    """Return the largest distance of an angle from the nearest other one, degrees."""
    distance = np.abs((np.subtract.outer(found, turned) + 180.0) % 360.0 - 180.0)
    return float(distance.min(axis=1).max()) if distance.size else np.inf


@case(slow=True)
def petaling():
    """a ball driven through a thin plate of metal: cracks like rays, local damage, and energies that balance (reduced size)"""
    with tempfile.TemporaryDirectory() as folder:
        record = alone(read_scene(SCENE, COARSE)).run(Path(folder) / "out", quiet=True)
        place = read_points(Path(folder) / "out")["position"]
        _, _, fields = read_frame(Path(folder) / "out")
    found = rays(place[:, :2], fields["damage"], 8e-3, 0.75e-3)
    turned = rays(place[:, 1::-1] * [-1, 1], fields["damage"], 8e-3, 0.75e-3)
    return [
        at_most("share of particles with damage above 0.05", float((fields["damage"] > 0.05).mean()), 0.1, "local damage: a ductile plate"),
        Check("cracks across a circle of 8 mm", len(found), 8, 0.0, "a star of cracks: Vermorel et al. 2010; their number is this scene's own"),
        at_most("largest turn of one against those after a quarter turn, degrees", _apart(found, turned), 5.0, "symmetry of plate, ball and lattice"),
        at_most("balance of energies over the largest", record["balance_error_relative"], 0.01, "first law"),
    ]
