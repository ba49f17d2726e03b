"""Scenes of finite elements that ship: run as they are, held against closed forms."""
from pathlib import Path

from pdhpc.parallel.comm import world
from pdhpc.scene.read import read_scene
from pdhpc.simulation import Simulation
from pdhpc.study.verify.case import Check, at_most, case

SCENE = Path(__file__).resolve().parents[3] / "runs" / "plate_with_hole_fe.toml"
_SOURCE = "Kirsch 1898; Timoshenko & Goodier, section 35"


@case
def fem_kirsch():
    """A wide plate with a round hole, from a gmsh file, concentrates a pull by 3 at the hole's edge, and by -1 in line with it"""
    simulation = Simulation(read_scene(SCENE), world())
    record = simulation.run(quiet=True)
    across, in_line, support = (probe.read(simulation.stepper) for probe in simulation.probes)
    pull = record["scene"]["load"][2]["value"][0]
    side = 20.0  # m, half of the height
    return [
        Check("stress along the pull at the hole's edge across it, over the pull", across[0] / pull, 3.0, 0.02, _SOURCE),
        Check("the same, finite width counted", across[0] / pull, (2 + 0.95**3) / 0.95, 0.01, "Heywood 1952, d/W = 0.05"),
        Check("stress across the pull at the hole's edge in line with it, over the pull", in_line[1] / pull, -1.0, 0.03, _SOURCE),
        at_most("normal stress on the free edge of the hole, over the pull", across[1] / pull, 0.04, "no traction there"),
        Check("force of the symmetry plane, over that of the pull", -support[0] / (pull * side), 1.0, 1e-9, "equilibrium"),
    ]
