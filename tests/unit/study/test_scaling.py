import json
from pathlib import Path

import pytest

from pdhpc.cli import main
from pdhpc.output.record import OutputError
from pdhpc.scene.read import read_scene
from pdhpc.scene.schema import SceneError
from pdhpc.study import scaling
from pdhpc.study.scaling import COLUMNS, efficiencies, read_rows, read_study, run_study, scene_of_point, spread, table_text

STUDIES = sorted((Path(__file__).resolve().parents[3] / "runs" / "studies").glob("*_?d.toml"))
TEXT = 'scene = "block.toml"\nkind = "strong"\nranks = [1, 2]\nrepeats = 1\n'
BLOCK = """
dimension = "3d"
[particles]
spacing = 1.0
horizon = 2.0
[[material]]
name = "a"
density = 1.0
youngs_modulus = 1.0
[[body]]
name = "b"
material = "a"
shape = "box"
lower = [0.0, 0.0, 1.0]
upper = [2.0, 3.0, 5.0]
[time]
end = 1.0
"""


@pytest.fixture
def study(tmp_path):
    (tmp_path / "block.toml").write_text(BLOCK)
    (tmp_path / "study.toml").write_text(TEXT)
    return tmp_path / "study.toml"


def row(ranks, seconds, repeat=0, particles=100, kind="strong", **more):
    phases = {f"{name}_{which}": seconds / len(scaling.PHASES) for name in scaling.PHASES for which in ("mean", "slowest")}
    blank = [name for name in COLUMNS if name not in ("study", "commit")]  # those the parent adds
    return {**dict.fromkeys(blank, 0), **phases, "ranks": ranks, "repeat": repeat, "seconds": seconds, "steps": 10, "particles": particles, "kind": kind, **more}


@pytest.mark.parametrize("path", [path for path in STUDIES if not path.name.startswith("block")], ids=lambda path: path.stem)
def test_the_studies_of_the_project_are_valid_and_their_scenes_are_there(path):
    study = read_study(path)
    assert scene_of_point(study, path.parent, 8).body[0].shape == "box"


@pytest.mark.parametrize("change, words", [
    ("ranks=[]", "ranks = []; allowed is one or more different whole numbers"), ("ranks=[1,1]", "ranks = [1, 1]"), ("ranks=[0]", "ranks = [0]"),
    ("steps=0", "steps = 0; allowed is a whole number of at least 1"), ('kind="wide"', 'kind = "wide"'), ("stepz=3", 'did you mean "steps"'),
    ('kind="weak"', "grow = []; allowed is one or more axes"), ('grow=["x"]', 'grow = ["x"]; allowed is one or more axes for kind = "weak", none for "strong"'),
    ("ranks=two", "not TOML"), ("ranks", "--set ranks; allowed is key=value"),
])
def test_a_bad_study_is_refused_in_one_sentence(study, change, words):
    with pytest.raises(SceneError) as error:
        read_study(study, [change])
    assert words in str(error.value) and "\n" not in str(error.value) and str(study) in str(error.value)


def test_a_missing_key_is_named(tmp_path):
    (tmp_path / "study.toml").write_text('kind = "strong"\n')
    with pytest.raises(SceneError, match="scene is missing"):
        read_study(tmp_path / "study.toml")


def test_meshes_are_refused(study):
    text = (study.parent / "block.toml").read_text()
    (study.parent / "block.toml").write_text(f'model = "fem"\n{text}\n[mesh]\ncell_size = {{}}\n'.format(read_scene(study.parent / "block.toml").particles.spacing))
    with pytest.raises(SceneError, match='model = "fem"; allowed is "particles"'):
        scaling.scene_of_point(read_study(study), study.parent, 1)


@pytest.mark.parametrize("number, axes, factors", [(1, 3, [1, 1, 1]), (8, 3, [2, 2, 2]), (12, 2, [4, 3]), (7, 2, [7, 1]), (16, 3, [4, 2, 2])])
def test_ranks_are_spread_over_axes(number, axes, factors):
    assert spread(number, axes) == factors


def test_a_weak_study_grows_its_boxes(study):
    weak = read_study(study, ['kind="weak"', 'grow=["x","z"]'])
    body = scene_of_point(weak, study.parent, 6).body[0]  # 6 = 3 x 2
    assert list(body.lower) == [0.0, 0.0, 1.0] and list(body.upper) == [6.0, 3.0, 9.0]


def test_efficiencies_are_medians_against_the_smallest_number_of_ranks():
    rows = [row(1, 8.0), row(1, 10.0, 1), row(1, 90.0, 2), row(4, 5.0)]
    table = efficiencies(rows)
    assert [(ranks, step, efficiency) for ranks, step, efficiency, _ in table] == [(1, 1.0, 1.0), (4, 0.5, 0.5)]  # 10 / (5 x 4)
    assert table[0][3]["force"] == pytest.approx(0.2)
    weak = efficiencies([row(2, 1.0, particles=100, kind="weak"), row(4, 1.25, particles=200, kind="weak")])
    assert weak[1][2] == pytest.approx(0.8)


def test_rows_of_another_commit_or_study_are_not_mixed(study, tmp_path, monkeypatch):
    monkeypatch.setattr(scaling, "_launch", lambda study, path, ranks: row(ranks, 1.0 / ranks))
    monkeypatch.setattr(scaling, "commit_of_program", lambda: "one")
    _, rows = run_study(study, tmp_path / "out", say=lambda text: None)
    assert [each["ranks"] for each in rows] == [1, 2] and {each["commit"] for each in rows} == {"one"}
    assert (tmp_path / "out" / "scaling.csv").read_text() == table_text(rows)
    monkeypatch.setattr(scaling, "commit_of_program", lambda: "two")
    with pytest.raises(OutputError, match="holds rows of commit one; allowed is commit two alone") as error:
        run_study(study, tmp_path / "out")
    assert error.value.exit_code == 2
    monkeypatch.setattr(scaling, "commit_of_program", lambda: "one")
    with pytest.raises(OutputError, match="holds rows of study"):
        run_study(study, tmp_path / "out", ["steps=3"])


def test_a_point_runs_alone_and_what_is_done_is_not_run_again(study, tmp_path, monkeypatch):
    calls = []
    monkeypatch.setattr(scaling, "_launch", lambda study, path, ranks: calls.append(ranks) or row(ranks, 1.0))
    run_study(study, tmp_path / "out", point=1, say=lambda text: None)
    assert calls == [2]
    (tmp_path / "out" / "points" / "ranks_000009_repeat_000.json").write_text('{"torn')  # what a kill may leave
    run_study(study, tmp_path / "out", say=lambda text: None)
    assert calls == [2, 1] and [each["ranks"] for each in read_rows(tmp_path / "out")] == [1, 2]
    run_study(study, tmp_path / "out", again=True, say=lambda text: None)
    assert calls == [2, 1, 1, 2]
    with pytest.raises(SceneError, match="--point 2; allowed is 0 to 1"):
        run_study(study, tmp_path / "out", point=2)


def test_a_launch_that_fails_is_told(study, tmp_path):
    (tmp_path / "block.toml").write_text(BLOCK.replace("end = 1.0", "end = 100.0\ndt = 50.0"))
    with pytest.raises(OutputError, match="the launch on 1 ranks failed"):
        run_study(study, tmp_path / "out", ["ranks=[1]"])


def test_the_command_measures_and_draws(study, tmp_path, capsys):
    with pytest.raises(SystemExit) as end:
        main(["scale", str(study), "-o", str(tmp_path / "out"), "--set", "ranks=[1,2]", "--set", "steps=4", "--set", "warm_up=1"])
    assert end.value.code == 0
    rows = read_rows(tmp_path / "out")
    assert [each["ranks"] for each in rows] == [1, 2] and all(each["particles"] == 24 and each["steps"] == 4 for each in rows)
    assert all(0 < each["force_mean"] < each["seconds"] and each["output"] > 0 for each in rows)
    # 2 x 3 x 4 cells cut in two across their longest side, families of 2 cells: each half is the other's ghosts, 12 particles of 24 bytes
    assert rows[1]["ghosts"] == 24 and rows[1]["bytes_per_step"] == 24 * 24
    assert json.loads((tmp_path / "out" / "points" / "ranks_000002_repeat_000.json").read_text()) == rows[1]
    assert {"efficiency.png", "phases.png", "scaling.csv"} <= {path.name for path in (tmp_path / "out").iterdir()}
    assert "efficiency" in capsys.readouterr().out
