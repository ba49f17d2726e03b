"""Something that fails on one rank, or on all: every rank stops, one message, exit code 1, run.json knows why, what was complete can be read."""
import pytest

from pdhpc.output.checkpoint import generations
from pdhpc.output.fields import frame_times, read_frame
from pdhpc.study.verify.case import plate
from pdhpc.study.verify.static import still
from tests.faults.injected import AT_STEP, begin, end, one_sentence, record
from tests.faults.soak import RUN, SCENE, differences

BUILD = """
import pdhpc.simulation as simulation
from pdhpc.parallel.comm import agree_on_error
def build(scene, comm, once=simulation.build):
    {what}
        if RANK == 1:
            raise KeyError("lost")
    return once(scene, comm)
simulation.build = build
"""
"""Fails on rank 1 in set-up, where the others hear of it or not."""


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path / "scene.toml"


@pytest.mark.parametrize("ranks, when, speaks", [(1, "True", None), (2, "RANK == 1", 1), (3, "True", 0), (3, "RANK > 0", 1)], ids=["alone", "one of two", "all", "two of three"])
def test_an_unexpected_exception_in_a_step(tmp_path, scene, ranks, when, speaks):
    code, said = end(begin(ranks, AT_STEP.format(when=when, step=50, deed='raise KeyError("lost")'), "run", scene, "-o", tmp_path / "out", *RUN))
    assert code == 1 and sum(line.startswith("Traceback") for line in said) == 1 and said[-1] == "KeyError: 'lost'", said
    assert said[0] == ("Traceback (most recent call last):" if speaks is None else f"rank {speaks} of {ranks}:"), said
    kept = record(tmp_path / "out")
    assert (kept["status"], kept["error"], kept["steps"]) == ("failed", "KeyError: 'lost'", 50)
    assert [int(path.stem.split("_")[1]) for path in generations(tmp_path / "out")] == [48, 44]
    assert len(frame_times(tmp_path / "out")) > 2 and read_frame(tmp_path / "out")


@pytest.mark.parametrize("what", ["if True:", "with agree_on_error(comm):"], ids=["unheard", "heard of by all"])
def test_an_unexpected_exception_in_set_up(tmp_path, scene, what):
    code, said = end(begin(3, BUILD.format(what=what), "run", scene, "-o", tmp_path / "out", *RUN))
    assert code == 1 and said[0] == "rank 1 of 3:" and sum(line.startswith("Traceback") for line in said) == 1 and said[-1] == "KeyError: 'lost'", said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_number_that_is_not_finite(tmp_path, scene, ranks):
    """It does not get into a checkpoint, where it would take the place of a good state: without it the run goes on to the same end."""
    spoil = AT_STEP.format(when=f"RANK == {ranks - 1}", step=50, deed="self.subdomain.particles.velocity[self.subdomain.particles.slots[3]] = float('nan')")
    words = [*RUN, "--set", "output.history_every=10e-6", "--set", "output.frames=1"]
    code, said = end(begin(ranks, spoil, "run", scene, "-o", tmp_path / "out", *words))
    assert code == 1 and "is not finite at step 52" in one_sentence(said)
    assert one_sentence(said) == f"pdhpc: {record(tmp_path / 'out')['error']}" and record(tmp_path / "out")["status"] == "failed"
    assert [int(path.stem.split("_")[1]) for path in generations(tmp_path / "out")] == [48, 44]
    if ranks == 2:
        assert end(begin(2, "", "restart", tmp_path / "out", "--quiet")) == (0, [])
        assert end(begin(2, "", "run", scene, "-o", tmp_path / "whole", *words)) == (0, [])
        assert differences(tmp_path / "whole", tmp_path / "out") == []


FINE = '[fine]\nshape = "disk"\ncenter = [0.0, 0.0]\nradius = 6.0\nstep_ratio = 4\ninterface = "exact"\n'
PULL = '[[initial]]\nregion = "all"\nvelocity_gradient = [[0.0, 0.0], [0.0, 1.5e-3]]\n'
HELD = """
[mesh]
cell_size = 1.0
[fem]
integration = "{}"
[[region]]
name = "left"
shape = "box"
lower = [-6.0, -3.0]
upper = [-5.0, 3.0]
[[load]]
type = "displacement"
region = "left"
value = [0.0, 0.0]
"""
GRAVITY = '[[load]]\ntype = "gravity"\nvalue = [0.0, -1e-4]\n'
CHECKED = "[checkpoint]\nsteps = 1\n"


@pytest.mark.parametrize("ranks, text, prefix, more", [
    (2, plate((30, 20), extra=FINE + PULL + CHECKED), "interface_", ["time.end=20.0", "output.frames=1"]),
    (1, still((12, 6), "newton", extra=GRAVITY, steps=2), "static_", []),
    (2, still((12, 6), "newton", extra=GRAVITY, steps=2), "static_", []),
    (2, 'model = "fem"\n' + plate((12, 6), extra=HELD.format("static") + GRAVITY), "gfem_", []),
    (2, 'model = "fem"\n' + plate((12, 6), extra=HELD.format("newmark") + GRAVITY + CHECKED), "gfem_", ["time.dt=0.5"]),
], ids=["interface", "newton, 1 rank", "newton", "static elements", "newmark"])
def test_a_solver_that_does_not_converge(tmp_path, ranks, text, prefix, more):
    (tmp_path / "scene.toml").write_text(text)
    words = [word for each in more for word in ("--set", each)]
    code, said = end(begin(ranks, "", "run", tmp_path / "scene.toml", "-o", tmp_path / "out", "--quiet", *words, "--", f"-{prefix}ksp_max_it", "1"))
    assert code == 1 and f"the KSP {prefix} did not converge in 1 iterations" in one_sentence(said), said
    kept = record(tmp_path / "out")
    assert kept["status"] == "failed" and one_sentence(said) == f"pdhpc: {kept['error']}" and read_frame(tmp_path / "out", 0)
    assert generations(tmp_path / "out") == [], "a state that no solver has found is not one to go on from"
