"""Going on in the same process: every digit as if the run had not been stopped. On several ranks: tests/mpi/test_restart.py."""
import json
import shutil

import numpy as np
import pytest

from pdhpc import restart
from pdhpc.output.checkpoint import generations, read_header
from pdhpc.output.fields import frame_times, read_frame
from pdhpc.output.record import OutputError
from pdhpc.restart import find, scene_of
from pdhpc.scene.read import parse_scene, read_scene
from pdhpc.scene.schema import SceneError
from pdhpc.simulation import Simulation
from pdhpc.study.verify.bodies import cracked, write_table
from pdhpc.study.verify.case import plate
from pdhpc.study.verify.fracture import GROWING_CRACK
from pdhpc.study.verify.static import still
from tests import going_on
from tests.faults.methods import ELEMENTS

SHORT = ["time.end=14e-6", "output.frames=7", "tip.crack.window=2e-6"]


def run(folder, comm, text=GROWING_CRACK, overrides=SHORT, **checkpoint):
    words = [f"checkpoint.{key}={value}" for key, value in {"at_end": "false", **checkpoint}.items()]
    return Simulation(parse_scene(text + "\n[checkpoint]\n", "crack", [*overrides, *words]), comm).run(folder, quiet=True)


def resume(folder, comm, overrides=()):
    saved = find(folder)
    return Simulation(scene_of(saved[0], folder, overrides), comm).resume(folder, saved, quiet=True)


def same(one, other):
    """Compare the history and every frame of two runs, digit for digit."""
    assert (one / "history.csv").read_text() == (other / "history.csv").read_text()
    assert frame_times(one) == frame_times(other)
    for frame in range(len(frame_times(one))):
        for name, values in read_frame(one, frame)[2].items():
            assert np.array_equal(values, read_frame(other, frame)[2][name]), (frame, name)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a run that was not stopped."""
    from mpi4py import MPI

    folder = tmp_path_factory.mktemp("whole")
    assert run(folder, MPI.COMM_SELF)["broken_bonds"] > 100
    return folder


def test_a_continued_run_is_the_uninterrupted_one(tmp_path, comm, whole):
    run(tmp_path, comm, steps=25)
    before = json.loads((tmp_path / "run.json").read_text())
    steps = [int(path.stem.split("_")[1]) for path in generations(tmp_path)]
    assert len(steps) == 2 and steps[0] < before["steps"]
    resume(tmp_path, comm)
    record = json.loads((tmp_path / "run.json").read_text())
    same(whole, tmp_path)
    for key in ("status", "steps", "energies", "broken_bonds", "tips", "bond_evaluations", "balance_error_relative"):
        assert record[key] == before[key], key


def test_a_later_end_can_be_set(tmp_path, comm, whole):
    run(tmp_path, comm, overrides=["time.end=8e-6", "output.frames=4", "tip.crack.window=2e-6", "time.dt=2e-8"], at_end="true")
    run(tmp_path / "whole", comm, overrides=[*SHORT, "time.dt=2e-8"])
    assert resume(tmp_path, comm, ["time.end=14e-6", "output.frames=7"])["status"] == "done"
    same(tmp_path / "whole", tmp_path)


def test_a_damaged_newest_one_falls_back_to_the_older(tmp_path, comm, whole):
    run(tmp_path, comm, steps=25)
    newest, older = generations(tmp_path)
    content = bytearray(newest.read_bytes())
    content[len(content) // 2] ^= 4
    newest.write_bytes(content)
    record = resume(tmp_path, comm)
    assert f"{newest}: damaged" in record["warnings"][0] and f"goes on from step {int(older.stem.split('_')[1])}" in record["warnings"][0]
    same(whole, tmp_path)
    newest.write_bytes(content[:100])
    older.write_bytes(b"")
    with pytest.raises(OutputError, match="damaged") as caught:
        find(tmp_path)
    assert caught.value.exit_code == 2


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file() and path.name != "run.log"}


@pytest.mark.parametrize("name", ["history.csv", "fields/points.h5", "fields.h5"])
def test_a_run_whose_files_are_damaged_is_left_as_it_is(tmp_path, comm, name):
    """Frames behind the checkpoint would be removed, and run.json written anew."""
    run(tmp_path, comm, plate((6, 4)), ["output.frames=4", "time.dt=0.1", "time.end=8.0"], steps=50)
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:100])
    before = contents(tmp_path)
    with pytest.raises(OutputError, match="cannot be continued .*; allowed ") as caught:
        resume(tmp_path, comm)
    assert caught.value.exit_code == 2 and contents(tmp_path) == before


def test_a_checkpoint_of_another_run_is_not_gone_on_from(tmp_path, comm):
    """Of a heavier body with the same particles, put beside those of the run as a newer one."""
    overrides = ["output.frames=4", "time.dt=0.1", "time.end=8.0"]
    run(tmp_path / "one", comm, plate((6, 4)), overrides, steps=30)
    run(tmp_path / "other", comm, plate((6, 4)), [*overrides, "material.solid.density=2.0"], steps=70)
    foreign = generations(tmp_path / "other")[0]
    shutil.copy(foreign, tmp_path / "one" / "checkpoint")
    saved = find(tmp_path / "one")
    assert saved[0].header["step"] == 60 and "step_000000070.h5: is of another run than" in saved[0].warning
    for path in generations(tmp_path / "one")[1:]:
        path.unlink()
    with pytest.raises(OutputError, match="is of another run than .*; allowed is the folder of a run that saved its state"):
        find(tmp_path / "one")


def test_what_a_run_knew_is_known_after_a_restart(tmp_path, comm, monkeypatch):
    """Warnings, seconds and PETSc options; a restart by other code is told."""
    scene = parse_scene(plate((6, 4)) + "\n[checkpoint]\nsteps = 30\nat_end = false\n", "plate", ["output.frames=4", "time.dt=0.1", "time.end=8.0"])
    first = Simulation(scene, comm, ["-static_ksp_rtol", "1e-9"])
    first.warnings.append("of the first session")
    first.seconds["setup"] += 1000.0
    record = first.run(tmp_path, quiet=True)
    again = resume(tmp_path, comm)
    assert again["warnings"][0] == "of the first session" and (record["restarts"], again["restarts"]) == (0, 1) and again["run"] == record["run"]
    assert again["seconds"]["setup"] > 1000.0 and again["seconds_slowest_rank"]["setup"] > 1000.0
    assert record["petsc_options"] == ["-static_ksp_rtol", "1e-9"] == find(tmp_path)[0].header["petsc_options"]
    monkeypatch.setattr(restart, "commit", lambda: "another")
    assert any("was written by other code (commit " in warning and "now another): digits may differ" in warning for warning in resume(tmp_path, comm)["warnings"])


def test_what_users_removed_begins_anew(tmp_path, comm):
    """To make room on a disk, say; the state is that of the checkpoint."""
    overrides = ["output.frames=4", "time.dt=0.1", "time.end=8.0"]
    run(tmp_path / "whole", comm, plate((6, 4)), overrides)
    run(tmp_path / "cut", comm, plate((6, 4)), overrides, steps=30)
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    (cut / "fields" / "frame_000020.h5").unlink()
    record = resume(cut, comm)
    assert any("1 frames are not there any more (frame_000020.h5 and so on): they are left out" in warning for warning in record["warnings"])
    assert [step for _, step, _ in frame_times(cut)] == [0, 40, 60, 80] and (whole / "history.csv").read_text() == (cut / "history.csv").read_text()
    for path in (cut / "fields").iterdir():
        path.unlink()
    for name in ("fields.h5", "history.csv", "run.json", "run.log"):
        (cut / name).unlink()
    record = resume(cut, comm)
    assert [words for words in ("its fields are not there any more: they begin anew at step 60", "history.csv: is not there any more: it begins anew at step 60")
            if not any(words in warning for warning in record["warnings"])] == []
    assert [step for _, step, _ in frame_times(cut)] == [60, 80]
    lines, rows = (whole / "history.csv").read_text().splitlines(), (cut / "history.csv").read_text().splitlines()
    assert rows == [lines[0], *lines[-2:]]
    assert np.array_equal(read_frame(cut)[2]["displacement"], read_frame(whole)[2]["displacement"])


def test_what_may_not_change_is_refused_by_name(tmp_path, comm):
    run(tmp_path, comm, plate((4, 4)), ["output.frames=1", "time.end=8.0"], at_end="true")
    saved = find(tmp_path)
    for override in ("time.dt=1e-3", "material.solid.density=2", "particles.horizon=4"):
        with pytest.raises(SceneError, match=f"--set {override}; allowed is time.end, and keys of output and checkpoint"):
            scene_of(saved[0], tmp_path, [override])
    assert scene_of(saved[0], tmp_path, ["output.frames=3", "checkpoint.minutes=2"]).checkpoint.minutes == 2
    with pytest.raises(OutputError, match="allowed is a time.end of at least that") as caught:
        resume(tmp_path, comm, [f"time.end={1.5 * saved[0].header['dt']}"])
    assert caught.value.exit_code == 2


def test_nothing_to_go_on_from(tmp_path, comm):
    run(tmp_path, comm, plate((4, 4)), ["output.frames=1"])
    with pytest.raises(OutputError, match="no checkpoint found; allowed is the folder of a run that saved its state"):
        find(tmp_path)


@pytest.mark.parametrize("more", [["material.glass.model=lps", "material.glass.poissons_ratio=0.22", "material.glass.failure=energy"], ["material.glass.stretch_softening=0.25"]],
                         ids=["by energy", "softened"])
def test_laws_whose_limits_depend_on_the_state_go_on_as_well(tmp_path, comm, more):
    """Bonds that are beyond their limit once others broke do not break when the state is put in, but in the next step, as they would have."""
    overrides = [*SHORT, *more]
    run(tmp_path / "whole", comm, overrides=overrides)
    assert run(tmp_path / "stopped", comm, overrides=overrides, steps=45)["broken_bonds"] > 50
    resume(tmp_path / "stopped", comm)
    same(tmp_path / "whole", tmp_path / "stopped")


def test_files_of_bodies_are_found_from_anywhere(tmp_path, comm, monkeypatch):
    write_table(tmp_path / "points.txt", cracked((8, 6)))
    (tmp_path / "scene.toml").write_text(cracked((8, 6), body='shape = "table"\nfile = "points.txt"') + "\n[checkpoint]\n")
    monkeypatch.chdir(tmp_path)
    record = Simulation(read_scene("scene.toml", ["output.frames=1"]), comm).run("out", quiet=True)
    monkeypatch.chdir("/")
    again = resume(tmp_path / "out", comm)
    assert again["broken_bonds"] == record["broken_bonds"] and again["warnings"] == record["warnings"]
    with open(tmp_path / "scene.toml", "a") as file:
        file.write("# changed\n")
    assert f"{tmp_path / 'scene.toml'} was changed since the run began" in resume(tmp_path / "out", comm)["warnings"][-2]  # the last one is of the balance


def test_files_of_bodies_must_be_what_the_run_read(tmp_path, comm):
    write_table(tmp_path / "points.txt", cracked((8, 6)))
    scene = parse_scene(cracked((8, 6), body='shape = "table"\nfile = "points.txt"') + "\n[checkpoint]\n", str(tmp_path / "scene.toml"), ["output.frames=1"])
    assert list(Simulation(scene, comm).run(tmp_path / "out", quiet=True)["files"]) == ["points.txt"]
    text = (tmp_path / "points.txt").read_text()
    (tmp_path / "points.txt").write_text(text + "# a word more\n")
    with pytest.raises(OutputError, match="points.txt: is not what it was when the run read it; allowed is the file with SHA-256 ") as caught:
        find(tmp_path / "out")
    assert caught.value.exit_code == 2
    (tmp_path / "points.txt").unlink()
    with pytest.raises(OutputError, match="points.txt: cannot be read .No such file or directory.; allowed is"):
        find(tmp_path / "out")
    (tmp_path / "points.txt").write_text(text)
    assert find(tmp_path / "out")


def test_the_log_goes_on(tmp_path, comm):
    run(tmp_path, comm, plate((6, 4)), ["output.frames=2"], at_end="true")
    resume(tmp_path, comm, ["time.end=80.0"])
    lines = [line.split("  ")[-1] for line in (tmp_path / "run.log").read_text().splitlines()]
    steps = read_header(generations(tmp_path)[0])["step"]
    assert sum(line.startswith("command: ") for line in lines) == 2 and lines[-1].startswith(f"done: {steps} steps, ")
    assert any(line.startswith("goes on from step ") for line in lines) and sum(line.startswith("checkpoint of step ") for line in lines) == 2


def test_the_load_path_of_a_body_at_rest_is_fixed(tmp_path, comm):
    text = still((6, 4), "newton", extra='[[load]]\ntype = "gravity"\nvalue = [1e-6, 0.0]\n', steps=2)
    run(tmp_path, comm, text, ["output.frames=1"], steps=1)
    with pytest.raises(SceneError, match="time.end = 9; allowed is 1: the load path of a body that stands still is fixed"):
        resume(tmp_path, comm, ["time.end=9.0"])


ALONE = {**{name: case for name, case in going_on.CASES.items() if name not in going_on.ON_RANKS or name in ("pinned", "galerkin")}, **going_on.COMPARATORS}


@pytest.mark.parametrize("name", ALONE)
def test_every_method_goes_on(tmp_path, comm, name):
    """The rest, and patches that have grown for long: what follows from the state is summed up in the same order."""
    record = going_on.run(ALONE[name], comm, tmp_path)
    expected = going_on.answer(tmp_path)
    again = going_on.resume(ALONE[name], comm, tmp_path)
    going_on.same(going_on.answer(tmp_path), expected)
    going_on.same_record(again, record)


def test_the_load_of_static_elements_is_fixed_as_well(tmp_path, comm):
    """They are one load step, whose length is time.end."""
    run(tmp_path, comm, ELEMENTS, ["output.frames=1", "mesh.cell_size=2.0", "fem.integration=static", "load.0.value=[0.01, 0.0]"], at_end="true")
    with pytest.raises(SceneError, match="time.end = 90; allowed is 60: the load path of a body that stands still is fixed"):
        resume(tmp_path, comm, ["time.end=90.0"])
