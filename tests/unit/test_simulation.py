import json
import signal

import numpy as np
import pytest

from pdhpc.output.checkpoint import generations
from pdhpc.output.fields import frame_times, read_frame, read_points
from pdhpc.output.history import read_history
from pdhpc.output.record import OutputError
from pdhpc.run import RunError
from pdhpc.scene.read import parse_scene, read_scene
from pdhpc.simulation import Simulation
from pdhpc.study.verify.case import plate
from pdhpc.study.verify.fracture import GROWING_CRACK
from pdhpc.warm_up import PATHS
from tests.unit.scene.test_elastic import GRIP, HELD, POINT
from tests.unit.scene.test_mesh_rules import FEM

MOVING = '[[initial]]\nvelocity = [0.001, 0.0]\n[[probe]]\nname = "p"\npoint = [0.0, 0.0]\nquantity = "velocity"\n'


def test_a_run_leaves_everything(tmp_path, comm):
    scene = parse_scene(plate((12, 8), extra=MOVING), "moving.toml", ["time.end=20.0", "output.frames=4"])
    record = Simulation(scene, comm).run(tmp_path / "out", quiet=True)
    assert record == {**json.loads((tmp_path / "out" / "run.json").read_text()), **{k: record[k] for k in ("seconds", "seconds_slowest_rank", "tips")}}
    assert record["status"] == "done" and record["particles"] == 96 and record["ranks"] == 1 and record["steps"] == record["steps_planned"]
    assert record["energies"]["kinetic_energy"] == pytest.approx(0.5 * 96 * 1e-6)
    times = [time for _, _, time in frame_times(tmp_path / "out")]
    assert len(times) == 5 and times[0] == 0.0 and times[-1] == pytest.approx(20.0)
    history = read_history(tmp_path / "out" / "history.csv")
    assert history["p.velocity_x [m/s]"].tolist() == [pytest.approx(0.001)] * 5
    assert read_frame(tmp_path / "out")[2]["displacement"][:, 0] == pytest.approx(0.02)
    assert len(read_points(tmp_path / "out")["id"]) == 96


def test_an_error_that_nobody_expects_is_in_the_log(tmp_path, comm, monkeypatch):
    simulation = Simulation(parse_scene(plate((4, 4)), "t", ["output.frames=1"]), comm)
    monkeypatch.setattr(simulation.energies, "read", lambda stepper: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        simulation.run(tmp_path, quiet=True)
    text = (tmp_path / "run.log").read_text()
    assert "CRITICAL  rank 0 of 1\nTraceback (most recent call last):" in text and text.endswith("ZeroDivisionError: division by zero\n")


def test_a_second_run_needs_overwrite(tmp_path, comm):
    scene = parse_scene(plate((4, 4)), "t", ["output.frames=1"])
    Simulation(scene, comm).run(tmp_path, quiet=True)
    with pytest.raises(OutputError, match="holds another run"):
        Simulation(scene, comm).run(tmp_path, quiet=True)
    Simulation(scene, comm).run(tmp_path, overwrite=True, quiet=True)


@pytest.mark.parametrize("frames, words", [(1, "not finite"), (20, "energy balance is off by")])
def test_an_unstable_step_ends_with_an_error_and_a_record(tmp_path, comm, frames, words):
    spin = "[[initial]]\nvelocity_gradient = [[0.1, 0.0], [0.3, 0.0]]\n"
    scene = parse_scene(plate((8, 8), extra=spin), "t", ["time.dt=4.0", "time.end=4000.0", "time.allow_unstable=true", f"output.frames={frames}"])
    with pytest.raises(RunError, match=words), np.errstate(all="ignore"):
        Simulation(scene, comm).run(tmp_path, quiet=True)
    record = json.loads((tmp_path / "run.json").read_text())
    assert f"ERROR     {record['error']}" in (tmp_path / "run.log").read_text().splitlines()[-1]
    assert record["status"] == "failed" and words in record["error"] and "above the critical step" in record["warnings"][0]


CHOICES = [[f"particles.path={path}", *model] for path in PATHS for model in ([], ["material.glass.model=lps", "material.glass.poissons_ratio=0.22"])]


@pytest.mark.parametrize("overrides", CHOICES, ids=lambda overrides: " ".join(overrides))
def test_a_few_lines_of_python_without_output(comm, overrides):
    record = Simulation(parse_scene(GROWING_CRACK, "crack", ["time.end=8e-6", *overrides]), comm).run(quiet=True)
    assert record["status"] == "done" and record["energies"]["external_work"] > 0
    assert record["path"].startswith(overrides[0].split("=")[1]) and record["bytes_sent_per_step"] == record["ghosts"] == 0


@pytest.mark.parametrize("overrides", CHOICES, ids=lambda overrides: " ".join(overrides))
def test_same_scene_same_numbers(comm, overrides):
    runs = [Simulation(parse_scene(GROWING_CRACK, "crack", ["time.end=5e-6", *overrides]), comm) for _ in range(2)]
    for run in runs:
        run.run(quiet=True)
    first, second = (run.stepper.subdomain.particles.displacement for run in runs)
    assert np.array_equal(first, second)


@pytest.mark.parametrize("model", CHOICES[:2], ids=("pmb", "lps"))
def test_either_path_runs_the_same_crack(comm, model):
    """The same bonds break, and displacements agree to rounding, while a crack grows over a tenth of the plate."""
    runs = [Simulation(parse_scene(GROWING_CRACK, "crack", ["time.end=14e-6", f"particles.path={path}", *model[1:]]), comm) for path in PATHS]
    records = [run.run(quiet=True) for run in runs]
    assert records[0]["broken_bonds"] == records[1]["broken_bonds"] > 100
    assert np.array_equal(*(run.problem.subdomain.bonds.alive() for run in runs))
    u, w = (run.problem.subdomain.particles.owned(run.problem.subdomain.particles.displacement) for run in runs)
    assert np.abs(u - w).max() < 1e-9 * np.abs(u).max()

FINE = '[fine]\nshape = "disk"\ncenter = [0.0, 0.0]\nradius = 4.0\nstep_ratio = 4\n'


@pytest.mark.parametrize("method", ("mts", "subcycling", "micro"))
def test_two_regions_leave_what_one_body_does(tmp_path, comm, method):
    text = plate((24, 16), kinematics="finite", extra=FINE + MOVING, material="critical_stretch = 0.1")
    overrides = ["time.end=20.0", "output.frames=4", 'output.fields=["displacement", "velocity", "damage", "stress"]']
    record = Simulation(parse_scene(text, "t", [*overrides, f"time.method={method}"]), comm).run(tmp_path / "out", quiet=True)
    single = Simulation(parse_scene(text, "t", [*overrides, "time.method=single"]), comm).run(tmp_path / "single", quiet=True)
    assert record["particles"] == single["particles"] == 384 and record["bonds"] == single["bonds"] and record["broken_bonds"] == 0
    assert record["energies"]["kinetic_energy"] == pytest.approx(single["energies"]["kinetic_energy"], rel=1e-9)
    assert read_frame(tmp_path / "out")[2]["displacement"][:, 0] == pytest.approx(0.02, rel=1e-6)
    assert sorted(read_points(tmp_path / "out")["id"]) == list(range(384))
    history = read_history(tmp_path / "out" / "history.csv")
    assert history["p.velocity_x [m/s]"].tolist() == pytest.approx([0.001] * 5, rel=1e-6)
    assert (record["coupling"] is not None) == (method == "mts") == ("displacement_gap [m]" in history)
    if method == "mts":
        regions = record["coupling"]["regions"]
        assert regions["coarse"]["dt"] == pytest.approx(4 * regions["fine"]["dt"]) and record["coupling"]["interface"] == "polynomial"
        assert regions["coarse"]["particles"] + regions["fine"]["particles"] == 384 + record["coupling"]["overlap_particles"]
        assert history["bond_evaluations_fine"][-1] == regions["fine"]["bond_evaluations"] and record["coupling"]["velocity_gap"] < 1e-9


def test_damage_in_the_overlap_is_reported(comm):
    pull = '[[initial]]\nregion = "all"\nvelocity_gradient = [[0.0, 0.0], [0.0, 6e-3]]\n'
    scene = parse_scene(plate((24, 16), kinematics="finite", extra=FINE + pull, material="critical_stretch = 0.02"), "t", ["time.end=20.0", "output.frames=1"])
    record = Simulation(scene, comm).run(quiet=True)
    assert record["coupling"]["broken_in_overlap"] > 0 and f"({record['coupling']['broken_in_overlap']} bonds broke there)" in record["warnings"][-1]


@pytest.mark.parametrize("integration", ("explicit", "newmark", "static"))
def test_a_mesh_leaves_what_particles_do(tmp_path, comm, integration):
    fields = 'output.fields=["displacement", "velocity", "stress", "strain", "strain_energy_density", "force_density", "damage"]'
    overrides = [f"fem.integration={integration}", "output.frames=1", fields, "material.m.critical_stretch=0.1", "time.end=10.0"]
    scene = parse_scene(FEM + HELD + POINT + GRIP, "t", overrides)
    record = Simulation(scene, comm).run(tmp_path / "out", quiet=True)
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == record["status"] == "done"
    assert (record["cells"], record["vertices"], record["dofs"], record["cell_kind"], record["broken_bonds"]) == (200, 231, 462, "quad", 0)
    assert record["steps"] == record["steps_planned"] and record["energies"]["external_work"] > 0 and record["balance_error_relative"] < 0.05
    assert (record["ksp_iterations"] > 0) == (integration != "explicit") and record["warnings"] == ["the strength of material 'm' is not used: finite elements alone never fail"]
    points, frame = read_points(tmp_path / "out"), read_frame(tmp_path / "out")[2]
    assert points["cells"].shape == (200, 4) and np.isfinite(np.concatenate([values.ravel() for values in frame.values()])).all() and len(frame) == 7
    history = read_history(tmp_path / "out" / "history.csv")
    assert len(history["end.displacement_x [m]"]) == 2 and history["end.displacement_x [m]"][-1] > 0


def test_a_mesh_that_flies_apart_ends_with_an_error_and_a_record(tmp_path, comm):
    scene = parse_scene(FEM + HELD, "t", ["time.dt=0.9", "time.end=900.0", "time.allow_unstable=true", "output.frames=1"])
    with pytest.raises(RunError, match="the displacement of vertex .* is not finite"), np.errstate(all="ignore"):
        Simulation(scene, comm).run(tmp_path, quiet=True)
    assert json.loads((tmp_path / "run.json").read_text())["status"] == "failed"


def test_a_solver_that_fails_ends_with_an_error_and_a_record(tmp_path, comm):
    from petsc4py import PETSc

    PETSc.Options()["gfem_ksp_max_it"] = 1
    try:
        with pytest.raises(RunError, match="KSP gfem_ did not converge in 1 iterations"):
            Simulation(parse_scene(FEM + HELD + POINT, "t", ["fem.integration=static"]), comm).run(tmp_path, quiet=True)
    finally:
        PETSc.Options().delValue("gfem_ksp_max_it")
    assert "gfem_ did not converge" in json.loads((tmp_path / "run.json").read_text())["error"]


@pytest.mark.parametrize("method", ("relaxation", "newton"))
def test_a_body_that_stands_still_leaves_what_others_do(tmp_path, comm, method, request):
    scene = read_scene(request.path.parent / "scene" / "everything_static.toml", [f"time.method={method}", "static.iterations=10000"])
    record = Simulation(scene, comm).run(tmp_path / "out", quiet=True)
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == record["status"] == "done"
    assert record["method"] == method and record["steps"] == record["steps_planned"] == 4 and record["balance_error_relative"] < 1e-4
    found = record["equilibrium"]
    assert found["equilibria"] > 4 and found["largest_residual"] <= found["tolerance"] == 1e-8 and found["reference_force"] > 0 and record["warnings"] == []
    assert (found["ksp_iterations"] > 0) == (method == "newton") and record["coupling"] is None and record["broken_bonds"] > 0
    history = read_history(tmp_path / "out" / "history.csv")
    assert history["time [s]"].tolist() == [0.0, 0.25, 0.5, 0.75, 1.0] and history["residual"].max() <= 1e-8 and history["broken_in_step"].sum() == record["broken_bonds"]
    assert history["end.displacement_x [m]"] == pytest.approx(0.2 * history["time [s]"]) and history["grip.reaction_x [N]"][1] > 0
    assert [time for _, _, time in frame_times(tmp_path / "out")] == [0.0, 0.5, 1.0]


def test_an_equilibrium_that_is_not_found_ends_with_an_error_and_a_record(tmp_path, comm, request):
    scene = read_scene(request.path.parent / "scene" / "everything_static.toml", ["static.equilibria=2"])
    with pytest.raises(RunError, match="bonds break in each of 2 equilibria"):
        Simulation(scene, comm).run(tmp_path / "out", quiet=True)
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert "bonds break in each of 2 equilibria" in record["error"]
    history = read_history(tmp_path / "out" / "history.csv")
    assert history["step"][-1] == record["steps"] and history["broken_in_step"][-1] > 0, "the load step that failed is there to be seen"
    assert frame_times(tmp_path / "out")[-1][1] == record["steps"] and read_frame(tmp_path / "out")[2]["damage"].max() > 0


def test_what_is_not_finite_is_not_saved(tmp_path, comm):
    """Nor does it stop as if all were well when a signal asks for that: the guard looks every 100 steps, and before each checkpoint."""
    scene = parse_scene(plate((8, 8), extra=MOVING) + "\n[checkpoint]\nsteps = 4\n", "t", ["time.end=60.0", "time.dt=0.5", "output.frames=1"])
    simulation = Simulation(scene, comm)
    once = simulation.stepper.advance

    def advance():
        once()
        if simulation.stepper.step == 10:
            particles = simulation.problem.subdomain.particles
            particles.velocity[particles.slots[5]] = np.nan

    simulation.stepper.advance = advance
    with pytest.raises(RunError, match="not finite at step 12"):
        simulation.run(tmp_path, quiet=True)
    assert [int(path.stem.split("_")[1]) for path in generations(tmp_path)] == [8, 4]


@pytest.mark.parametrize("kind", [KeyError, KeyboardInterrupt])
def test_what_nobody_expected(tmp_path, comm, kind):
    """It goes on to the caller; run.json tells of it, unless somebody was in a hurry; signals are what they were."""
    simulation = Simulation(parse_scene(plate((4, 4), extra=MOVING), "t", ["output.frames=1"]), comm)
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)]

    def advance():
        raise kind("lost")

    simulation.stepper.advance = advance
    with pytest.raises(kind):
        simulation.run(tmp_path, quiet=True)
    record = json.loads((tmp_path / "run.json").read_text())
    assert (record["status"], record.get("error")) == (("failed", "KeyError: 'lost'") if kind is KeyError else ("running", None))
    assert before == [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)]
