"""Scenes of runs/ at reduced size: a brittle disc that is struck, and a double-notched strip that is torn."""
import math
import tempfile
from pathlib import Path

import numpy as np

from pdhpc.output.fields import read_frame, read_points
from pdhpc.output.history import read_history
from pdhpc.scene.read import read_scene
from pdhpc.study.verify.case import Check, alone, at_most, case

RUNS = Path(__file__).resolve().parents[3] / "runs"
SMALL_DISC = ["particles.spacing=0.8333333333333333e-3", "particles.horizon=2.5e-3", "body.disc.radius=15e-3", "time.end=40e-6", "output.frames=2", "output.pictures=false"]
COARSE_STRIP = ["particles.spacing=1.0e-3", "particles.horizon=3.0e-3", "static.steps=12", "output.frames=12", "output.pictures=false"]


def run_small(scene, overrides, folder):
    """Run a scene of runs/ with changes in this process alone; return its record."""
    return alone(read_scene(RUNS / scene, overrides)).run(folder, quiet=True)


def peak_by_fracture_mechanics(youngs_modulus=30e9, energy_release_rate=50.0, notch=12e-3, half_width=30e-3, thickness=1e-3):
    """Return the load, N, at which K_I = s sqrt(pi a) F(a/b) is sqrt(E G) (Tada, Paris & Irwin, double-edge notched strip)."""
    q = notch / half_width
    shape = (1.122 - 0.561 * q - 0.205 * q**2 + 0.471 * q**3 + 0.190 * q**4) / math.sqrt(1 - q)
    return math.sqrt(youngs_modulus * energy_release_rate) / (shape * math.sqrt(math.pi * notch)) * 2 * half_width * thickness


@case(slow=True)
def brittle_impact():
    """a sphere driven through a brittle disc: damage nearly everywhere, debris on the far side, energies that balance (reduced size)"""
    with tempfile.TemporaryDirectory() as folder:
        record = run_small("brittle_impact.toml", SMALL_DISC, Path(folder) / "out")
        z, fields = read_points(Path(folder) / "out")["position"][:, 2], read_frame(Path(folder) / "out")[2]
    return [
        Check("share of particles with damage above 0.05", float((fields["damage"] > 0.05).mean()), 0.75, 0.25, "more than half: Silling & Askari 2005", relative=False),
        Check("lowest particle, m, of a disc from 0 to 2.5 mm", float((z + fields["displacement"][:, 2]).min()), -6e-3, 5e-3, "debris leaves on the far side", relative=False),
        at_most("balance of energies over the largest", record["balance_error_relative"], 0.02, "first law"),
        Check("kinetic energy over the work of the sphere", record["energies"]["kinetic_energy"] / record["energies"]["external_work"], 1.0, 0.3, "little is left in bonds of dust"),
    ]


@case(slow=True)
def double_notch_tension():
    """a double-notched strip pulled at rest: the load rises straight, to that of fracture mechanics and what a horizon adds, and drops to nothing (reduced size)"""
    with tempfile.TemporaryDirectory() as folder:
        record = run_small("double_notch_tension.toml", COARSE_STRIP, Path(folder) / "out")
        history = read_history(Path(folder) / "out" / "history.csv")
    load, pull = history["grip.reaction_y [N]"], history["end.displacement_y [m]"]
    whole = (history["broken_bonds"] == 0) & (pull > 0)
    peak = float(load.max())
    return [
        at_most("departure of the load from a straight line while whole", float(np.abs(load[whole] / (load[1] / pull[1] * pull[whole]) - 1.0).max()), 1e-6, "linear kinematics"),
        Check("peak of the load over that of K_I = K_Ic", peak / peak_by_fracture_mechanics(), 1.25, 0.25, "Tada, Paris & Irwin; a horizon of a quarter of the notch adds to it", relative=False),
        at_most("load of the torn strip over the peak", float(load[-1]) / peak, 1e-3, "nothing holds it"),
        at_most("balance of energies over the largest", record["balance_error_relative"], 1e-6, "first law"),
    ]
