import numpy as np
import pytest

from pdhpc.peridynamics.newton import Newton
from pdhpc.peridynamics.relaxation import Relaxation
from pdhpc.scene.schema import SceneError
from pdhpc.scene.static import load_path
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.study.verify.static import still


@pytest.mark.parametrize("method, stepper", (("relaxation", Relaxation), ("newton", Newton)))
def test_the_method_chooses_the_stepper(method, stepper):
    problem = problem_of(still((8, 6), method, steps=5))
    assert type(problem.stepper()) is stepper and problem.n_steps == 5 and problem.dt == 0.2 and np.isinf(problem.critical_dt)


def test_the_load_path():
    problem = problem_of(still((8, 6), "relaxation", steps=5), ["static.breaking=most_strained", "particles.spacing=0.5"])
    path = load_path(problem.scene, problem.body)
    assert path == (0.2, 1e-10, 100_000, True, 500, 0.5, 16)
    problem = problem_of(still((8, 6), "newton"), ["static.iterations=7"])
    assert load_path(problem.scene, problem.body).iterations == 7


def supported(cells, *loads, dimension="plane_stress"):
    """Return the text of a box whose sides x < 0 and x > 0 bear displacements."""
    rest = [0.0] * (len(cells) - 1)
    text = "".join(f'[[region]]\nname = "{name}"\nshape = "half_space"\npoint = {[0.0, *rest]}\nnormal = {[sign, *rest]}\n' for name, sign in (("low", -1.0), ("high", 1.0)))
    text += "".join(f'[[load]]\ntype = "displacement"\nregion = "{region}"\nvalue = {value}\n' for region, value in loads)
    text += '[[probe]]\nname = "a"\nregion = "low"\nquantity = "damage"\n[[probe]]\nname = "b"\nregion = "high"\nquantity = "damage"\n'
    return plate(cells, extra=text, dimension=dimension).replace("end = 1.0\n", 'end = 1.0\nmethod = "relaxation"\n')


@pytest.mark.parametrize("cells, loads, free", [
    ((6, 6), [], 3),
    ((6, 6), [("low", '[0.0, "free"]')], 1),  # x along y holds the rotation; y is free
    ((6, 6), [("low", '["free", 0.0]')], 1),  # y along x holds it too; x is free
    ((6, 1), [("low", '[0.0, "free"]')], 2),  # a row: neither y nor the rotation
    ((4, 4, 4), [], 6),
    ((4, 4, 4), [("low", '[0.0, "free", "free"]')], 3),
    ((4, 4, 4), [("low", '["free", 0.0, 0.0]')], 1),
])
def test_free_rigid_motions_are_counted_and_refused(cells, loads, free):
    text = supported(cells, *loads, dimension="3d" if len(cells) == 3 else "plane_stress")
    with pytest.raises(SceneError, match=f"load = prescribed displacements that leave {free} rigid motions? of the body free"):
        problem_of(text)


def test_supports_far_from_the_origin_are_judged_alike():
    text = supported((6, 6), ("low", '[0.0, "free"]'), ("high", '["free", 0.0]'))
    assert problem_of(text).n_steps == 20
    shifted = text.replace("lower = [-3.0, -3.0]", "lower = [99997.0, 99997.0]").replace("upper = [3.0, 3.0]", "upper = [100003.0, 100003.0]")
    assert problem_of(shifted.replace("point = [0.0, 0.0]", "point = [100000.0, 0.0]")).n_steps == 20


def test_frames_between_load_steps_are_reported():
    problem = problem_of(still((8, 6), "newton", steps=4), ["output.times=[0.3, 0.75]"])
    assert problem.warnings == ["output.times = 0.3 s is no load step (0.25 s each): frames are those of the nearest ones"]
