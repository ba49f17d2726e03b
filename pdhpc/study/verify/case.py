"""What a check is: a measured number held against an expected one, with tolerance and source."""
import math
import tempfile
from pathlib import Path
from typing import Callable, NamedTuple

from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.simulation import Simulation
from pdhpc.study.launch import launch

CASES = {}


class Check(NamedTuple):
    """One number: it passes when |measured - expected| <= tolerance (times |expected| when `relative`)."""

    what: str
    measured: float
    expected: float
    tolerance: float
    source: str
    relative: bool = True

    @property
    def passed(self):
        """Whether the check holds; NaN never does."""
        allowed = self.tolerance * (abs(self.expected) if self.relative and self.expected != 0 else 1.0)
        return math.isfinite(self.measured) and abs(self.measured - self.expected) <= allowed


class Case(NamedTuple):
    """A named function that returns Checks; slow ones run in `pdhpc verify` alone, not among the tests."""

    name: str
    meaning: str
    function: Callable
    slow: bool = False


def case(function=None, *, slow=False):
    """Register a function as the verification case of its name; the first line of its docstring is its meaning."""
    if function is None:
        return lambda function: case(function, slow=slow)
    CASES[function.__name__] = Case(function.__name__, function.__doc__.strip().splitlines()[0], function, slow)
    return function


def at_most(what, measured, bound, source):
    """Return a Check that measured lies in [-bound, bound]."""
    return Check(what, measured, 0.0, bound, source, relative=False)


def problem_of(text, overrides=()):
    """Return the Problem of a scene text, built in this process alone."""
    from mpi4py import MPI

    return build(parse_scene(text, "verification scene", overrides), MPI.COMM_SELF)


def simulation_of(text):
    """Return the Simulation of a scene text in this process alone."""
    return alone(parse_scene(text, "verification scene"))


def alone(scene):
    """Return the Simulation of a Scene in this process alone."""
    from mpi4py import MPI

    return Simulation(scene, MPI.COMM_SELF)


def on_two_ranks(scene, judge):
    """Run a scene file on two ranks; return the Checks of judge(directory), or one that says that the run failed."""
    with tempfile.TemporaryDirectory() as folder:
        done = launch(2, ["run", str(scene), "-o", "out", "--quiet", "--set", "output.pictures=false"], folder)
        if done.returncode != 0:
            return [Check(f"exit code ({done.stderr.strip()[-200:]})", done.returncode, 0.0, 0.0, "a run that ends")]
        return judge(Path(folder) / "out")


def plate(cells=(40, 40), ratio=3.0, spacing=1.0, kinematics="linear", extra="", material="", dimension="plane_stress"):
    """Return the text of a box scene: E = 1, density 1, never breaking unless `material` says so; one unit of length per spacing, centred on 0."""
    half = [count * spacing / 2 for count in cells]
    return f"""
dimension = "{dimension}"
[particles]
spacing = {spacing}
horizon = {ratio * spacing}
kinematics = "{kinematics}"
[[material]]
name = "solid"
density = 1.0
youngs_modulus = 1.0
{material}
[[body]]
name = "body"
material = "solid"
shape = "box"
lower = {[-x for x in half]}
upper = {half}
[time]
end = 1.0
[output]
pictures = false
{extra}
"""
