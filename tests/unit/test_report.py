from pdhpc import report
from pdhpc.scene.explain import explain
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import plate


def test_check_says_what_a_scene_would_do(capsys):
    report.print_check(parse_scene(plate((20, 10), material="energy_release_rate = 0.1"), "t"), 2)
    text = capsys.readouterr().out
    for words in ("particles", "200", "bonds", "critical stretch", "Ha & Bobaru", "critical step", "steps", "memory per rank", "estimated time"):
        assert words in text


def test_explanation_lists_keys(capsys):
    report.print_explanation(explain(parse_scene(plate(), "t")))
    text = capsys.readouterr().out
    assert "particles.horizon" in text and "given" in text and "default" in text and "kg/m^3" in text


def test_units_of_size_and_time():
    assert report._size(1234) == "1.23 kB" and report._size(5e12) == "5 TB"
    assert report._duration(30) == "30.0 s" and report._duration(600) == "10.0 min" and report._duration(1e5) == "27.8 h" and report._duration(float("inf")) == "unknown"
