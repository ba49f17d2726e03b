"""Degenerate but legal scenes: a particle, no bonds, ranks with nothing, everything broken, one cell, no patch; each runs, is drawn, and goes on."""
import contextlib
import io
from pathlib import Path

import numpy as np

from pdhpc.cli import main
from pdhpc.output.checkpoint import generations
from pdhpc.output.fields import read_frame
from pdhpc.output.history import read_history
from pdhpc.parallel.comm import on_root
from pdhpc.report import print_check
from pdhpc.restart import find, scene_of
from pdhpc.scene.read import parse_scene
from pdhpc.simulation import Simulation
from pdhpc.study.verify.case import plate
from pdhpc.study.verify.static import still
from tests.faults.soak import differences

LPS = 'model = "lps"\npoissons_ratio = 0.2\n'
MOVES = '[[initial]]\nvelocity = {}\n'
PULLED = "[[initial]]\nvelocity_gradient = [[{}, 0.0], [0.0, 0.0]]\n"
FAR = '[[body]]\nname = "far"\nmaterial = "solid"\nshape = "box"\nlower = [19.5, -0.5]\nupper = [20.5, 0.5]\n'
HELD = '[[region]]\nname = "left"\nshape = "box"\nlower = [-0.5, -0.5]\nupper = [-0.4, 0.5]\n[[load]]\ntype = "displacement"\nregion = "left"\nvalue = [0.0, 0.0]\n'
GRAVITY = '[[load]]\ntype = "gravity"\nvalue = [1e-4, 0.0]\n'
CRACK = '[[crack]]\ntype = "polyline"\npoints = [[-0.2, 0.6], [0.2, 0.6]]\n'


def _particles():
    """Yield (name, text, overrides, bonds) of bodies of particles; bonds : (all, broken ones), None where any number will do."""
    for model, material in (("pmb", ""), ("lps", LPS)):
        for path in ("lattice", "cloud"):
            on, at = [f"particles.path={path}"], f"{model}, {path}"
            yield f"one particle, {at}", plate((1, 1), extra=MOVES.format([0.01, 0.0]), material=material), [*on, "time.dt=0.1"], (0, 0)
            yield f"no bonds, {at}", plate((1, 1), extra=FAR + MOVES.format([0.01, 0.0]), material=material), [*on, "time.dt=0.1"], (0, 0)
            yield f"three particles, {at}", plate((3, 1), extra=PULLED.format(0.01), material=material), [*on, "time.end=4.0", "time.dt=0.5"], (3, 0)
            everything = material + "critical_stretch = 1e-9\n"
            yield f"everything broken, {at}", plate((6, 4), extra=PULLED.format(0.01), material=everything, kinematics="finite"), [*on, "time.end=4.0"], (202, None)
            for method in ("newton", "relaxation"):
                yield f"one held particle, {method}, {at}", still((1, 1), method, model, steps=2), on, (0, 0)
                yield f"one held, three not, {method}, {at}", still((4, 1), method, model, steps=2, extra=GRAVITY), on, (6, 0)


def _elements():
    """Yield the same of one cell of elements, and of elements with particles."""
    for kind, dt in (("explicit", []), ("newmark", ["time.dt=0.5"]), ("static", [])):
        text = plate((1, 1), extra=HELD + GRAVITY + f'[mesh]\ncell_size = 1.0\n[fem]\nintegration = "{kind}"\n')
        yield f"one cell, {kind}", 'model = "fem"\n' + text, ["time.end=4.0", *dt], None
        if kind != "static":
            yield f"one free cell, {kind}", 'model = "fem"\n' + text.replace(HELD + GRAVITY, MOVES.format([0.01, 0.0])), ["time.end=4.0", *dt], None
    yield "one cell, moduli of the lattice", 'model = "fem"\n' + plate((4, 4), extra=PULLED.format(1e-4) + '[mesh]\ncell_size = 4.0\n[fem]\nmoduli = "lattice"\n'), ["time.end=4.0"], None
    for name, crack, material in (("no patch", "", ""), ("one patch", CRACK, "critical_stretch = 0.02")):
        text = plate((24, 16), extra="[mesh]\ncell_size = 4.0\n" + crack + PULLED.format(1e-4), material=material)
        yield name, 'model = "gfem"\n' + text, ["time.end=10.0"], None


CASES = {name: tuple(rest) for name, *rest in (*_particles(), *_elements())}


def try_case(comm, name, folder):
    """Hold that a scene runs, is explained and drawn, and that a run cut at half and gone on with is the uninterrupted one. Collective."""
    text, overrides, bonds = CASES[name]
    scene = parse_scene(text, "scene", overrides)
    record = Simulation(scene, comm).run(folder / "whole", quiet=True)
    assert record["status"] == "done" and record["steps"] == record["steps_planned"] >= 1
    if bonds is not None:
        assert record["bonds"] == bonds[0]
        assert record["broken_bonds"] == bonds[1] if bonds[1] is not None else record["broken_bonds"] > 0.6 * bonds[0]
    half = [*overrides, f"checkpoint.steps={max(1, record['steps'] // 2)}", "checkpoint.at_end=false"]
    Simulation(parse_scene(text + "\n[checkpoint]\n", "scene", half), comm).run(folder / "cut", quiet=True)
    if record["steps"] > 1:
        on_root(comm, _drop_the_end, folder / "cut", record["steps"])
        saved = on_root(comm, find, folder / "cut")
        assert 0 < saved[0].header["step"] < record["steps"]
        Simulation(scene_of(saved[0], folder / "cut", ()), comm).resume(folder / "cut", saved, quiet=True)
    on_root(comm, _look_at, folder, scene)


def _drop_the_end(folder, last):
    """Remove a checkpoint of the last step, that of half the steps is to be gone on from."""
    for path in generations(folder):
        if int(path.stem.split("_")[1]) == last:
            path.unlink()


def _look_at(folder, scene):
    """Hold that two runs are the same, their numbers finite, and that they can be drawn."""
    assert differences(folder / "whole", folder / "cut") == []
    for column, values in read_history(folder / "whole" / "history.csv").items():
        assert np.isfinite(values).all(), column
    for field, values in read_frame(folder / "whole")[2].items():
        assert np.isfinite(values).all(), field
    from mpi4py import MPI

    with contextlib.redirect_stdout(io.StringIO()) as said:
        print_check(scene, None)
        if MPI.COMM_WORLD.size == 1:
            try:
                main(["view", str(folder / "whole")])
            except SystemExit as done:
                assert done.code == 0
    assert said.getvalue() and (MPI.COMM_WORLD.size > 1 or list(Path(folder / "whole").glob("*.png")))
