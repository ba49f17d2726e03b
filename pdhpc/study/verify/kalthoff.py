"""The shipped scene: a plate struck between its notches (Kalthoff & Winkler 1988)."""
import json
import math
from pathlib import Path

import numpy as np

from pdhpc.output.fields import read_frame, read_points
from pdhpc.study.verify.branching import rayleigh_speed
from pdhpc.study.verify.case import Check, at_most, case, on_two_ranks

SCENE = Path(__file__).resolve().parents[3] / "runs" / "kalthoff_winkler.toml"
_SOURCE = "65 to 72 degrees: Kalthoff & Winkler 1988 70, Silling 2003 68"


@case(slow=True)
def kalthoff_winkler():
    """cracks leave the notches of a struck plate at 65 to 72 degrees, mirror images of each other (2 ranks, about a minute)"""
    return on_two_ranks(SCENE, judge)


def judge(directory):
    """Return the Checks of a finished run of the scene."""
    record = json.loads((Path(directory) / "run.json").read_text())
    position, damage = read_points(directory)["position"], read_frame(directory)[2]["damage"]
    spacing, tips, energies = record["scene"]["particles"]["spacing"], record["tips"], record["energies"]
    upper, lower = np.array(tips["upper"]["position"]), np.array(tips["lower"]["position"])
    limit = rayleigh_speed(190e9, 0.3, 8000)
    return [
        Check("upper crack, from the notch's end to its own, degrees", _degrees(upper - [0.05, 0.025]), 68.5, 3.5, _SOURCE, relative=False),
        Check("upper crack, line through its path, degrees", _degrees(tips["upper"]["path_direction"]), 68.5, 3.5, _SOURCE, relative=False),
        Check("lower crack, line through its path, degrees", _degrees(tips["lower"]["path_direction"]), -68.5, 3.5, _SOURCE, relative=False),
        at_most("distance of the lower crack's end from the upper's mirror image, in spacings", np.abs(upper - lower * [1, -1]).max() / spacing, 2.0, "symmetry"),
        Check("cracks reach the plate's edge", float(min(upper[1], -lower[1]) > 0.1 - spacing), 1.0, 0.0, "it falls into three"),
        Check("particles damaged between the notches", int(((damage > 0.35) & (np.abs(position[:, 1]) < 0.024)).sum()), 0, 0.0, "two cracks only"),
        at_most("largest tip speed over the Rayleigh speed", max(tip["largest_speed"] for tip in tips.values()) / limit, 1.0, "Freund 1990"),
        at_most("balance error over dissipated energy", energies["balance_error"] / energies["dissipated_energy"], 0.05, "first law"),
    ]


def _degrees(vector):
    """Return the angle of a vector to the notches, degrees."""
    return math.degrees(math.atan2(vector[1], vector[0]))
