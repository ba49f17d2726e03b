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


def test_summary_of_a_coupled_run(capsys):
    """No number of degrees of freedom, which changes as patches grow; the coupling in its place."""
    coupling = {"scheme": "pinned", "sub_steps": 4, "particle_dt": 0.5, "patches": 9, "active_share": 0.125}
    body = {"cells": 16, "vertices": 25, "path": "lattice", "particles": 400, "bonds": 6190, "coupling": coupling}
    run = {"title": "t", "ranks": 1, "steps": 20, "dt": 2.0, "critical_dt": 4.0, "seconds": {"solve": 1.0}, "broken_bonds": 3, "energies": {}, "tips": {}, "fragments": None, "warnings": []}
    report.print_summary({**body, **run, "balance_error_relative": None}, "out", [])
    text = capsys.readouterr().out
    for words in ("16, 25; 9 patches", "pinned, 4 of 0.5 s", "12.5% of the particles", "400, 6,190"):
        assert words in text


def test_check_lists_what_bodies_hold_and_stops_at_a_dozen(capsys):
    many = "".join(f'[[body]]\nname = "b{k}"\nmaterial = "solid"\nshape = "box"\nlower = [{20 * k}.0, 0.0]\nupper = [{20 * k + 2}.0, 2.0]\n' for k in range(1, 14))
    report.print_check(parse_scene(plate((4, 4), extra=many), "t"), 1)
    said = capsys.readouterr().out
    assert "16 particles, 16 m^3, 16 kg; drawn 16 m^3" in said and "b11" in said and "b12" not in said and "and 2 bodies more" in said


def test_check_counts_the_pieces_of_a_mesh(capsys, comm):
    from tests.unit.scene.test_mesh_rules import FEM, SECOND

    for lower, rows in (([10.0, 0.0], 0), ([11.0, 0.0], 1)):  # the second box touches the first, or stands apart
        report.print_check(parse_scene(FEM + SECOND.replace("[10.0, 0.0]", str(lower)), "t"), 1)
        assert capsys.readouterr().out.count("2 that share no facet with each other") == rows
