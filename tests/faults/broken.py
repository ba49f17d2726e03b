"""Inputs that are broken: scenes from those in runs/, meshes, tables, checkpoints; tools/broken tries many."""
import contextlib
import copy
import io
import json
import signal
import sys
import tempfile
import warnings
from functools import partial
from pathlib import Path

import meshio
import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pdhpc.cli import main
from pdhpc.output.checkpoint import generations, read_header, restore, write_checkpoint
from pdhpc.output.record import OutputError
from pdhpc.parallel.comm import on_root
from pdhpc.scene.build import build
from pdhpc.scene.explain import explain
from pdhpc.scene.read import changed_scene, parse_scene, tomllib
from pdhpc.scene.room import check_room
from pdhpc.scene.schema import SceneError
from pdhpc.state import SUM, rows, whole
from pdhpc.simulation import Simulation
from pdhpc.study.verify.bodies import cracked, write_table
from pdhpc.study.verify.case import plate

RUNS = Path(__file__).parents[2] / "runs"
SCENES = {path: tomllib.loads(path.read_text()) for path in sorted(RUNS.glob("*.toml"))}
_SLOWEST = 60  # s
VALUES = st.one_of(
    st.booleans(), st.integers(-3, 3), st.sampled_from([10**9, -(10**9), 10**30, 2**63, 1e300, -1e300, 1e-300, 5e-324, float("inf"), float("nan"), 0.0, -0.0, "", "x", "free",
        "auto", "Ω\u202e\x00", "../../../etc/passwd", "$(reboot)", "__import__('os')", "none", [], {}, [[]], [0.0], [0.0, 0.0], [1.0, 2.0, 3.0], [1.0, "free"], ["glass"], {"x": 1}, [{}]]),
    st.text(max_size=6), st.floats(), st.lists(st.floats(), max_size=4))


def _places(value, path=()):
    """Yield the paths of all values in a dict of tables."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, each in items:
        yield (*path, key)
        yield from _places(each, (*path, key))


@st.composite
def scenes(draw):
    """(path of a shipped scene, its tables with one to three of their values, keys or tables changed)."""
    path = draw(st.sampled_from(list(SCENES)))
    data = copy.deepcopy(SCENES[path])
    for _ in range(draw(st.integers(1, 3))):
        places = list(_places(data))
        if not places:
            break
        place = draw(st.sampled_from(places))
        target = data
        for key in place[:-1]:
            target = target[key]
        deed = draw(st.sampled_from(["change", "change", "change", "scale", "remove", "add", "double"]))
        if deed == "remove":
            del target[place[-1]]
        elif deed == "add" and isinstance(target, dict):
            target[draw(st.one_of(st.text(max_size=8), st.sampled_from(["horizn", "file", "group", "mass", "inner_radius", "time", "velocity"])))] = copy.deepcopy(draw(VALUES))
        elif deed == "double" and isinstance(target, list):
            target.append(copy.deepcopy(target[place[-1]]))
        elif deed == "scale" and isinstance(target[place[-1]], (int, float)):
            target[place[-1]] *= draw(st.sampled_from([-1, 0.1, 0.37, 10, 1e6, 1e-6]))
        else:
            target[place[-1]] = copy.deepcopy(draw(VALUES))
    return path, data


@contextlib.contextmanager
def in_time(what):
    """Stop with a word on what was tried when a case hangs."""
    def stop(number, frame):
        raise AssertionError(f"took more than {_SLOWEST} s: {what}")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(_SLOWEST)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def is_a_sentence(error):
    """Hold that an error is one line of words that can be printed."""
    words = str(error)
    assert words and len(words.splitlines()) == 1 and words.isprintable() and "; allowed " in words, repr(words)


def try_scene(comm, case):
    """Hold that a scene is accepted, or refused in one sentence."""
    path, data = case
    with in_time(repr(case)):
        try:
            scene = changed_scene(data, str(path), ())
            check_room(scene, comm)
            explain(scene)
            json.dumps(scene.resolved())
        except SceneError as error:
            is_a_sentence(error)


TEXT = cracked((8, 6))


def table_lines():
    with tempfile.TemporaryDirectory() as folder:
        write_table(Path(folder) / "t", TEXT)
        return (Path(folder) / "t").read_text().splitlines()


@st.composite
def tables(draw, lines):
    """The text of a table with some of its lines or words changed, or cut short."""
    lines = list(lines)
    for _ in range(draw(st.integers(1, 3))):
        row = draw(st.integers(1, len(lines) - 1))
        words = lines[row].split()
        deed = draw(st.sampled_from(["word", "word", "remove", "add", "repeat", "cut", "bytes"]))
        if deed == "repeat":
            lines.insert(row, lines[row])
        elif deed == "cut":
            lines = lines[: row + 1] if row > 1 else lines
            lines[-1] = lines[-1][: draw(st.integers(0, len(lines[-1])))]
        elif deed == "remove" and words:
            words.pop(draw(st.integers(0, len(words) - 1)))
            lines[row] = " ".join(words)
        elif words:
            words.insert(draw(st.integers(0, len(words) - 1)), draw(st.sampled_from(["nan", "inf", "-1", "0", "1e300", "1e-300", "x", "1,5", "9" * 400, "0x1p3", "\u0663", "\x00"])))
            if deed == "word":
                words.pop()
            lines[row] = " ".join(words)
    return "\n".join(lines) + draw(st.sampled_from(["\n", ""]))


@st.composite
def damaged(draw, content):
    """Bytes with some changed, removed, doubled or replaced by words, or cut short."""
    content = bytearray(content)
    for _ in range(draw(st.integers(1, 3))):
        if not content:
            break
        at = draw(st.integers(0, len(content) - 1))
        deed = draw(st.sampled_from(["flip", "cut", "drop", "word", "double"]))
        if deed == "flip":
            content[at] ^= 1 << draw(st.integers(0, 7))
        elif deed == "cut":
            del content[at:]
        elif deed == "drop":
            del content[at : at + draw(st.integers(1, 40))]
        elif deed == "double":
            content[at:at] = content[at : at + draw(st.integers(1, 40))]
        else:
            content[at : at + 4] = draw(st.sampled_from([b" nan", b" -7 ", b"1e99", b"\n\n", b"999999999999", b"\xff\xfe", b"0 0 0"]))
    return bytes(content)


MESHES = ("msh", "inp", "vtk", "vtu")


def mesh_bytes(suffix):
    """The bytes of a mesh of 8 by 6 quadrilaterals."""
    x, y = np.meshgrid(np.arange(9.0), np.arange(7.0), indexing="ij")
    number = np.arange(63).reshape(9, 7)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    points = np.stack([x.ravel(), y.ravel(), np.zeros(63)], axis=1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"m.{suffix}"
        options = {"file_format": "gmsh22", "binary": False} if suffix == "msh" else {"binary": False} if suffix in ("vtk", "vtu") else {}
        meshio.write(path, meshio.Mesh(points, [("quad", quads)]), **options)
        return path.read_bytes()


def try_body(comm, folder, shape, content):
    """Hold that a body from a file is built, or refused in one sentence."""
    name = "body.txt" if shape == "table" else f"body.{shape}"
    on_root(comm, (folder / name).write_bytes, content)
    text = cracked((8, 6), body=f'shape = "{"table" if shape == "table" else "mesh"}"\nfile = "{name}"')
    with in_time(content[:200]), np.errstate(all="ignore"):
        try:
            build(parse_scene(text, str(folder / "scene.toml")), comm)
        except SceneError as error:
            is_a_sentence(error)


def entries(comm):
    """Entries of every kind, 500 rows in all."""
    mine, random = slice(comm.rank, None, comm.size), np.random.default_rng(0)
    u, bonds = random.random((500, 2))[mine].copy(), random.integers(0, 255, (500, 3)).astype(np.uint8)[mine].copy()
    ids = np.arange(500, dtype=np.int64)[mine]
    return {"u": rows(u, ids), "bonds": rows(bonds, ids), "sum": rows(np.ones(3), SUM), "all": whole(np.ones(2))}


def try_checkpoint(comm, path, content):
    """Hold that a damaged checkpoint is read with every bit right, or refused in one sentence."""
    on_root(comm, path.write_bytes, content)
    fresh, right = entries(comm), entries(comm)
    for entry in fresh.values():
        entry.get()[...] = 0
    with in_time("checkpoint"):
        try:
            restore(comm, path, on_root(comm, read_header, path), fresh)
        except OutputError as error:
            assert len(str(error).splitlines()) == 1, repr(str(error))
            return
    for key, entry in fresh.items():
        assert np.array_equal(entry.get(), right[key].get()), f"{key} was read wrong"


def try_run(folder, before, name, content):
    """Hold that a run with a damaged file is drawn and gone on with, or refused in one sentence and exit code 2, as it was left.

    before : {path: bytes} of the files of its folder.
    """
    for words in (["view", str(folder)], ["restart", str(folder), "--quiet"]):
        (folder / name).write_bytes(content)
        said = io.StringIO()
        try:
            with in_time(name), contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()), np.errstate(all="ignore"), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                main(words)
        except SystemExit as done:
            assert done.code in (0, 2), said.getvalue()
            assert done.code == 0 or len(said.getvalue().splitlines()) == 1, said.getvalue()
            changed = [path.name for path, kept in before.items() if path.suffix != ".log" and path != folder / name and path.read_bytes() != kept]
            assert done.code == 0 or not changed, f"{name} was damaged, {words[0]} refused, and changed {changed}: {said.getvalue()}"
        for path, kept in before.items():
            path.write_bytes(kept)


def try_all(comm, times, folder):
    """Try `times` broken scenes, a tenth as many tables, meshes and checkpoints, and a hundredth of each file of a run (of which there are ten)."""
    def tried(examples):
        return settings(max_examples=max(1, examples), deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck))

    tried(times)(given(scenes())(lambda case: try_scene(comm, case)))()
    tried(times // 10)(given(tables(table_lines()))(lambda text: try_body(comm, folder, "table", text.encode("utf-8", "surrogatepass"))))()
    for suffix in MESHES:
        tried(times // 10 // len(MESHES))(given(damaged(mesh_bytes(suffix)))(lambda content: try_body(comm, folder, suffix, content)))()
    write_checkpoint(comm, folder, {"step": 1}, entries(comm))
    path = generations(folder)[0]
    content = comm.bcast(path.read_bytes() if comm.rank == 0 else None)
    tried(times // 10)(given(damaged(content))(lambda content: try_checkpoint(comm, path, content)))()
    if comm.size > 1:  # pictures are drawn by one
        return
    text = plate((6, 4)) + "\n[checkpoint]\nsteps = 6\nat_end = false\n"
    Simulation(parse_scene(text, "plate", ["output.frames=2", "output.pictures=false", "time.dt=0.5", "time.end=8.0"]), comm).run(folder / "run", quiet=True)
    before = {path: path.read_bytes() for path in (folder / "run").rglob("*") if path.is_file()}
    for file in before:
        each = partial(try_run, folder / "run", before, str(file.relative_to(folder / "run")))
        tried(times // 100)(given(damaged(file.read_bytes()))(lambda content: each(content)))()


if __name__ == "__main__":
    from pdhpc.parallel.comm import world

    with tempfile.TemporaryDirectory() as place:
        try_all(world(), int(sys.argv[1]) if len(sys.argv) > 1 else 2000, Path(world().bcast(place)))
        world().Barrier()
    if world().rank == 0:
        print("every one was accepted, or refused in one sentence")
