"""The shipped scene: a crack in glass that branches (Ha & Bobaru 2010)."""
import json
import math
from pathlib import Path

import numpy as np

from pdhpc.output.fields import read_frame, read_points
from pdhpc.study.verify.case import Check, at_most, case, on_two_ranks

SCENE = Path(__file__).resolve().parents[3] / "runs" / "glass_branching.toml"


def rayleigh_speed(youngs_modulus, poissons_ratio, density):
    """Return the Rayleigh speed, m/s, by Viktorov's approximation c_R = c_s (0.862 + 1.14 nu)/(1 + nu) (0.5 % or better)."""
    shear = math.sqrt(youngs_modulus / (2 * (1 + poissons_ratio)) / density)
    return shear * (0.862 + 1.14 * poissons_ratio) / (1 + poissons_ratio)


def branches(position, damage, x, spacing, threshold=0.35):
    """Return the ordinates of the cracks that cross the line x, m: means of the groups of damaged particles in the two columns next to it."""
    near = (np.abs(position[:, 0] - x) < spacing) & (damage > threshold)
    y = np.sort(position[near, 1])
    if len(y) == 0:
        return []
    groups = np.split(y, np.flatnonzero(np.diff(y) > 3 * spacing) + 1)
    return [float(group.mean()) for group in groups]


@case
def glass_branching():
    """the crack in glass ends in two mirror-image branches and stays below 0.66 of the Rayleigh speed (2 ranks, about a minute)"""
    return on_two_ranks(SCENE, judge)


def judge(directory):
    """Return the Checks of a finished run of the scene."""
    record = json.loads((Path(directory) / "run.json").read_text())
    points = read_points(directory)
    _, _, fields = read_frame(directory)
    spacing = record["scene"]["particles"]["spacing"]
    tip = record["tips"]["crack"]
    horizon = record["scene"]["particles"]["horizon"]
    lines = np.arange(0.5 * (0.065 + tip["position"][0]), tip["position"][0] - horizon, 2 * spacing)
    found = [branches(points["position"], fields["damage"], x, spacing) for x in lines]
    counts = sorted({len(each) for each in found})
    two = [each for each in found if len(each) == 2]
    asymmetry = max((abs(each[0] + each[1]) for each in two), default=math.nan)
    limit = 0.66 * rayleigh_speed(65e9, 1 / 3, 2235)
    return [
        Check("branches, fewest over the second half of their length", counts[0], 2, 0.0, "Ha & Bobaru 2010"),
        Check("branches, most over the second half of their length", counts[-1], 2, 0.0, "Ha & Bobaru 2010"),
        at_most("largest distance of one branch from the other's mirror image, in spacings", asymmetry / spacing, 2.0, "symmetry"),
        Check("branches reach x = 0.085 m", float(tip["position"][0] > 0.085), 1.0, 0.0, "Ha & Bobaru 2010"),
        at_most("largest tip speed over 0.66 Rayleigh speeds", tip["largest_speed"] / limit, 1.0, "Ha & Bobaru 2010; Ravi-Chandar 2004"),
    ]
