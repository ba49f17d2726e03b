"""A small run of every method, some seconds long, that saves its state every few steps: what is killed, stopped and gone on with."""
from typing import NamedTuple

from pdhpc.study.verify.fracture import GROWING_CRACK
from pdhpc.study.verify.gfem_plate import CELL, Plate
from pdhpc.study.verify.static import notched


class Run(NamedTuple):
    """A scene and how it is run: text, overrides, and the steps between two checkpoints: few, so that much of the time is spent writing them."""

    text: str
    overrides: tuple
    steps: int

    def scene(self):
        """Return the text of the scene."""
        return f"{self.text}\n[checkpoint]\nsteps = {self.steps}\nat_end = false\n"

    def words(self):
        """Return the words of the command line that run it."""
        return [word for override in (*self.overrides, "output.pictures=false") for word in ("--set", override)] + ["--quiet"]


_FINE = """
[fine]
shape = "box"
lower = [0.01, -0.008]
upper = [0.07, 0.008]
step_ratio = 4
"""
_COUPLED = f"""
[mesh]
cell_size = {CELL}
[gfem]
substeps = 4
scheme = "SCHEME"
"""
ELEMENTS = """
model = "fem"
dimension = "plane_stress"
[mesh]
cell_size = 0.5
[[material]]
name = "rubber"
model = "elastic"
density = 1.0
youngs_modulus = 1.0
poissons_ratio = 0.3
[[body]]
name = "strip"
material = "rubber"
shape = "box"
lower = [-20.0, -10.0]
upper = [20.0, 10.0]
[[region]]
name = "left"
shape = "half_space"
point = [-19.9, 0.0]
normal = [-1.0, 0.0]
[[region]]
name = "right"
shape = "half_space"
point = [19.9, 0.0]
normal = [1.0, 0.0]
[[load]]
type = "displacement"
region = "left"
value = [0.01, "free"]
time = { function = "ramp", end = 9.0 }
[[load]]
type = "traction"
region = "right"
face = "+x"
value = [1e-3, 2e-3]
[[probe]]
name = "held"
region = "left"
quantity = "reaction"
[time]
end = 60.0
"""
_CRACK = ("time.end=30e-6", "output.frames=10", "output.history_every=2e-7")
_PLATE = ("output.frames=5", "output.history_every=0.01")
_STRIP = ("output.frames=5", "output.history_every=0.04")
_GROWING = Plate(5, 4, 2.6, 0.002, 0.02).text("gfem")

METHODS = {
    "particles": Run(GROWING_CRACK, _CRACK, 4),
    "mts": Run(GROWING_CRACK + _FINE, _CRACK, 4),
    "gfem": Run(_GROWING + _COUPLED.replace("SCHEME", "pinned"), _PLATE, 2),
    "galerkin": Run(_GROWING + _COUPLED.replace("SCHEME", "galerkin"), _PLATE, 2),
    "newton": Run(notched("newton", steps=25, cells=(60, 36)), _STRIP, 1),
    "relaxation": Run(notched("relaxation", steps=25, cells=(60, 36)), _STRIP, 1),
    "fem": Run(ELEMENTS, ("output.frames=5", "output.history_every=0.1"), 4),
}
