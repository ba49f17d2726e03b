"""Small runs of every method that stop once and go on: what they came to, and how it is compared."""
from typing import NamedTuple

import numpy as np

from pdhpc.output.fields import frame_times, read_frame, read_points
from pdhpc.output.history import read_history
from pdhpc.parallel.comm import on_root
from pdhpc.restart import find, scene_of
from pdhpc.scene.read import parse_scene
from pdhpc.simulation import Simulation
from pdhpc.study.verify.case import plate
from pdhpc.study.verify.static import notched
from tests.faults.methods import ELEMENTS
from tests.mpi.test_coupled import SCENES

_SECONDS = {"load_imbalance"}  # columns of the history that measure seconds


class Case(NamedTuple):
    """A run and the one step at which it saves its state.

    elsewhere : how far it may be off, relative to the largest value, when it goes on on another number of ranks. breaks : whether bonds break after the step.
    """

    text: str
    overrides: tuple
    step: int
    elsewhere: float
    breaks: bool = True

    def scene(self):
        """Return the Scene."""
        text = self.text if "[output]" in self.text else f"{self.text}\n[output]\npictures = false\n"
        words = [*self.overrides, "output.frames=6", f"checkpoint.steps={self.step}", "checkpoint.at_end=false"]
        return parse_scene(f"{text}\n[checkpoint]\n", "going on", words)


_FINE = '[fine]\nshape = "disk"\ncenter = [3.0, 1.0]\nradius = 7.0\nstep_ratio = 4\n'
_THROWN = '[[initial]]\nregion = "all"\nvelocity_gradient = [[0.0, 0.0], [0.0, 1.5e-3]]\n'
_PUSHED = """
[[region]]
name = "top"
shape = "half_space"
point = [0.0, 16.9]
normal = [0.0, 1.0]
[[load]]
type = "traction"
region = "top"
face = "+y"
value = [1e-4, 1e-4]
time = { function = "ramp", end = 60.0 }
[[load]]
type = "gravity"
value = [1e-6, 0.0]
time = { function = "ramp", end = 60.0 }
"""
_LPS = 'model = "lps"\npoissons_ratio = 0.2\n'


def _regions(kinematics="finite", material="critical_stretch = 0.02"):
    return plate((50, 36), kinematics=kinematics, extra=_FINE + _THROWN + _PUSHED, material=material)


def _coupled(name):
    return SCENES[name] + "[output]\npictures = false\nhistory_every = 9.0\n"


_MACRO = ("time.dt=0.8", "time.end=40.0", "output.history_every=4.0")
_ROUNDING = 1e-10
"""Of sums at vertices that ranks share, and of solvers that stop at 1e-12 of the right side: the interface's, galerkin's."""
_NEWMARK = 1e-8
"""Its solver stops at 1e-10 of the right side of each of some tens of steps."""
_EQUILIBRIUM = 1e-7
"""static.tolerance: how well forces are balanced."""
CASES = {
    "mts polynomial": Case(_regions(), _MACRO, 30, 0.0),
    "mts exact": Case(_regions("linear", ""), (*_MACRO, "fine.interface=exact"), 30, _ROUNDING, False),
    "mts exact, breaking": Case(_regions(), (*_MACRO, "fine.interface=exact"), 30, _ROUNDING),
    "mts lps": Case(_regions(material=_LPS + "critical_stretch = 0.02"), (*_MACRO, "time.dt=0.4"), 70, 0.0),
    "kick": Case(_regions(), (*_MACRO, "fine.interface=kick"), 30, 0.0),
    "subcycling": Case(_regions(), (*_MACRO, "time.method=subcycling"), 30, 0.0),
    "micro": Case(_regions(), (*_MACRO, "time.method=micro"), 30, 0.0),
    "pinned": Case(_coupled("growth"), ("time.end=180.0",), 49, _ROUNDING),
    "galerkin": Case(_coupled("growth"), ("time.end=180.0", "gfem.scheme=galerkin"), 42, _ROUNDING),
    "pinned, moved": Case(_coupled("prescribed motion"), ("time.end=180.0",), 59, _ROUNDING),
    "newton": Case(notched("newton", cells=(26, 15)), ("output.history_every=0.1",), 6, _EQUILIBRIUM),
    "relaxation": Case(notched("relaxation", cells=(26, 15)), ("output.history_every=0.1",), 6, 0.0),
    "explicit elements": Case(ELEMENTS, ("mesh.cell_size=1.0", "time.end=20.0", "output.history_every=2.0"), 13, 0.0, False),
    "newmark": Case(ELEMENTS, ("mesh.cell_size=1.0", "time.end=20.0", "output.history_every=2.0", "time.dt=0.5", "fem.integration=newmark"), 21, _NEWMARK, False),
}
COMPARATORS = {
    "instant": Case(_coupled("growth"), ("time.end=90.0", "time.dt=1.5", "gfem.scheme=instant"), 35, _ROUNDING),
    "literal": Case(_coupled("growth"), ("time.end=60.0", "time.dt=0.8", "gfem.scheme=literal"), 41, _ROUNDING),
}
"""Schemes that are there to compare with, each of whose steps looks for its critical step: slow."""


ON_RANKS = ("mts polynomial", "mts exact, breaking", "kick", "micro", "pinned", "galerkin", "newton", "relaxation", "explicit elements", "newmark")
"""Of CASES, those of which each has a solver, or a way to share work between ranks, of its own."""


def run(case, comm, folder):
    """Run a case to its end; return run.json. Collective."""
    return Simulation(case.scene(), comm).run(folder, quiet=True)


def resume(case, comm, folder):
    """Go on from the state it saved; return run.json. Collective."""
    saved = on_root(comm, find, folder)
    assert [each.header["step"] for each in saved] == [case.step]
    return Simulation(scene_of(saved[0], folder, ()), comm).resume(folder, saved, quiet=True)


def same_record(one, other):
    """Hold that two contents of run.json are the same, but for what measures seconds, and the place of the scene, which a restart spells out."""
    one, other = (_without_seconds({**record, "coupling": _without_seconds(record["coupling"] or {})}) for record in (one, other))
    assert set(one) == set(other)
    different = [key for key in set(one) - {"scene_file", "run", "restarts"} if one[key] != other[key]]
    assert not different, different


def _without_seconds(record):
    return {key: value for key, value in record.items() if "second" not in key and key not in _SECONDS}


class Answer(NamedTuple):
    """All that a run wrote: history {column: rows}, and [{field: values by id}] of its frames, with their times."""

    history: dict
    times: list
    frames: list


def answer(folder):
    """Read an Answer. Local."""
    order = np.argsort(read_points(folder)["id"])
    times = frame_times(folder)
    frames = [{name: values[order] for name, values in read_frame(folder, number)[2].items()} for number in range(len(times))]
    return Answer(read_history(folder / "history.csv"), times, frames)


def same(one, other):
    """Hold that two answers are the same, digit for digit."""
    assert one.times == other.times and set(one.history) == set(other.history)
    for column in set(one.history) - _SECONDS:
        assert np.array_equal(one.history[column], other.history[column], equal_nan=True), column
    for number, (a, b) in enumerate(zip(one.frames, other.frames)):
        for name in a:
            assert np.array_equal(a[name], b[name]), (number, name)


def close(one, other, tolerance):
    """Hold that two answers are close, relative to the largest value of a field, and to the largest energy; the same bonds break.

    What is counted, estimated, or nothing but the difference of two copies depends on how many ranks there are.
    """
    assert one.times == other.times and np.array_equal(one.history["broken_bonds"], other.history["broken_bonds"])
    energies = [column for column in one.history if column.endswith("_energy [J]") or column == "external_work [J]"]
    largest = max(np.abs(one.history[column]).max() for column in energies)
    for column in energies:
        assert np.abs(one.history[column] - other.history[column]).max() <= tolerance * largest, column
    for number, (a, b) in enumerate(zip(one.frames, other.frames)):
        for name in a:
            assert np.abs(a[name] - b[name]).max() <= tolerance * np.abs(a[name]).max(), (number, name)
