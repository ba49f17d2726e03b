"""Particles, volumes and masses of bodies, against counts by hand and volumes of shapes."""
import math

import pytest

from pdhpc.scene.amounts import amounts_of, missed
from pdhpc.study.verify.case import plate, problem_of

CYLINDER = '[[body]]\nname = "disc"\nmaterial = "solid"\nshape = "cylinder"\nstart = [20.0, 0.0, 0.0]\nend = [20.0, 0.0, {length}]\nradius = 8.0\ninner_radius = 4.0\n'


def found(text, comm, overrides=()):
    problem = problem_of(text, overrides)
    return problem.scene, amounts_of(problem.scene, problem.body, problem.parts, comm)


def test_a_box_holds_what_was_drawn_and_holes_leave_no_closed_form(comm):
    hole = '[[body.hole]]\nshape = "box"\nlower = [-1.0, -1.0]\nupper = [1.0, 1.0]\n'
    text = plate((6, 4), spacing=0.5, extra=hole).replace("horizon", "thickness = 2.0\nhorizon", 1).replace("density = 1.0", "density = 3.0")
    scene, (body,) = found(text, comm)
    assert body[:4] == ("body", 24 - 16, 8 * 0.25 * 2.0, 3.0 * 8 * 0.25 * 2.0) and body.drawn_volume is None and missed(scene, [body]) == []
    scene, (body,) = found(text.replace(hole, ""), comm)
    assert body.drawn_volume == pytest.approx(3.0 * 2.0 * 2.0, rel=1e-15) and body.volume == 12.0


def test_a_disc_of_two_and_a_half_layers_gets_three_and_says_so(comm):
    """A layer of the ring holds the cells whose centres lie 4 to 8 from its axis."""
    layer = sum(16 <= (x + 0.5) ** 2 + (y + 0.5) ** 2 <= 64 for x in range(-8, 8) for y in range(-8, 8))
    scene, amounts = found(plate((4, 4, 4), 2.0, dimension="3d", extra=CYLINDER.format(length=2.5)), comm)
    disc = amounts[1]
    assert disc.particles == 3 * layer and disc.volume == 3.0 * layer and disc.drawn_volume == pytest.approx(math.pi * (64 - 16) * 2.5)
    said, = missed(scene, amounts)
    share = 3 * layer / (math.pi * 48 * 2.5) - 1
    assert all(word in said for word in ("body 'disc'", f"{share:.1%} more", f"{disc.volume:.5g} m^3", f"{disc.drawn_volume:.5g} m^3", "divides its length, such as 0.83333 m")), said
    scene, amounts = found(plate((4, 4, 4), 2.0, dimension="3d", extra=CYLINDER.format(length=2.0)), comm)
    assert amounts[1].particles == 2 * layer and missed(scene, amounts) == []


def test_balls_and_disks_have_closed_forms(comm):
    ball = '[[body]]\nname = "b"\nmaterial = "solid"\nshape = "{}"\ncenter = {}\nradius = 1.9\n'
    scene, amounts = found(plate((4, 4, 4), 2.0, dimension="3d", extra=ball.format("sphere", [9.0, 0.0, 0.0])), comm)
    assert amounts[1].drawn_volume == pytest.approx(4 / 3 * math.pi * 1.9**3)
    scene, amounts = found(plate((4, 4), 2.0, extra=ball.format("disk", [9.0, 0.0])), comm)
    assert amounts[1].drawn_volume == pytest.approx(math.pi * 1.9**2) and amounts[1].particles == 12
    said, = missed(scene, amounts)
    assert "body 'b'" in said and "a spacing smaller than 1 m" in said and "5.8% more" in said
