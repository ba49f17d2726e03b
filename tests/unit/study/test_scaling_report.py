from pdhpc.study.scaling import PHASES, Study
from pdhpc.study.scaling_report import report, report_prediction


def row(ranks, seconds, particles, **more):
    """A row of ten steps whose phases share the time evenly."""
    phases = {f"{name}_{which}": seconds / len(PHASES) for name in PHASES for which in ("mean", "slowest")}
    plain = {"kind": "strong", "steps": 10, "bond_imbalance": 1.0, "bytes_per_step": 0}
    return {**plain, **phases, "ranks": ranks, "seconds": seconds, "particles": particles, **more}


def test_the_table_says_efficiency_and_shares(tmp_path, capsys):
    study = Study(title="a study", scene="x", kind="strong", ranks=[1, 2])
    rows = [row(1, 2.0, particles=1000), row(2, 1.25, particles=1000, bytes_per_step=4000, bond_imbalance=1.02)]
    pictures = report(study, rows, tmp_path)
    text = capsys.readouterr().out
    assert "80.0%" in text and "20.0%" in text and "2.0%" in text and all(path.stat().st_size > 1000 for path in pictures)


def test_a_prediction_is_drawn_and_says_what_it_ignores(tmp_path, capsys):
    study = Study(scene="x", kind="strong", ranks=[1, 2])
    picture = report_prediction(study, [row(1, 2.0, particles=1600), row(2, 1.25, particles=1600)], 2, 3.0, "archer2", tmp_path)
    text = capsys.readouterr().out
    assert "ignored: contention" in text and "ARCHER2" in text and picture.stat().st_size > 1000
