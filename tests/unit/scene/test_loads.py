import pytest
from pydantic import TypeAdapter, ValidationError

from pdhpc.scene.fields import Rule
from pdhpc.scene.loads import Initial, Load, Time

LOAD, TIME = TypeAdapter(Load), TypeAdapter(Time)


def test_loads_are_told_apart_by_their_type():
    load = LOAD.validate_python({"type": "displacement", "region": "r", "value": ["free", 1]})
    assert type(load).__name__ == "DisplacementLoad" and load.value == ["free", 1.0] and load.time.function == "constant"
    assert LOAD.validate_python({"type": "gravity", "value": [0.0, -9.81]}).region == "all"
    with pytest.raises(ValidationError):
        LOAD.validate_python({"type": "force_density", "value": [0.0, 1.0]})  # no region: only gravity acts on all by default
    with pytest.raises(ValidationError):
        LOAD.validate_python({"type": "force_density", "region": "r", "value": ["free", 1.0]})  # only motions have free components


@pytest.mark.parametrize("table, dim, words", [
    ({"type": "velocity", "region": "r", "value": ["free", "free"]}, 2, "at least one component that is a number"),
    ({"type": "velocity", "region": "r", "value": [1.0, 2.0]}, 3, "3 components in 3D"),
    ({"type": "traction", "region": "r", "value": [1.0, 2.0], "face": "-z"}, 2, 'face = "-z"'),
    ({"type": "gravity", "value": [1.0, 2.0], "time": {"function": "ramp", "start": 1.0, "end": 1.0}}, 2, "time.end = 1.0"),
])
def test_impossible_loads(table, dim, words):
    with pytest.raises(Rule, match=words):
        LOAD.validate_python(table).check(dim)


def test_time_functions():
    assert TIME.validate_python({"function": "sine", "frequency": 2.0}).phase == 0.0
    assert TIME.validate_python({"function": "ramp", "end": 1.0}).start == 0.0
    TIME.validate_python({"function": "table", "times": [0.0, 1.0], "values": [1.0, 0.0]}).check()
    with pytest.raises(Rule, match="after time.start"):
        TIME.validate_python({"function": "ramp", "start": 2.0, "end": 1.0}).check()
    with pytest.raises(Rule, match="each after the one before"):
        TIME.validate_python({"function": "table", "times": [0.0, 0.0], "values": [1.0, 0.0]}).check()
    with pytest.raises(Rule, match="as many values as times"):
        TIME.validate_python({"function": "table", "times": [0.0, 1.0], "values": [1.0]}).check()


def test_initial_states():
    Initial(velocity=[1.0, 0.0]).check(2)
    with pytest.raises(Rule, match="at least one of"):
        Initial(region="r").check(2)
    with pytest.raises(Rule, match="2 rows of 2 numbers"):
        Initial(velocity_gradient=[[1.0, 0.0], [1.0]]).check(2)
    with pytest.raises(Rule, match="origin"):
        Initial(velocity=[1.0, 0.0], origin=[0.0]).check(2)


def test_velocities_about_an_axis():
    Initial(radial_velocity=[1.0, 0.0, 2.0], axial_velocity=[0.0, 3.0], angular_velocity=[4.0], axis=[0.0, 0.0, 2.0], length=0.5).check(3)
    Initial(radial_velocity=[1.0], angular_velocity=[2.0], origin=[3.0, 4.0]).check(2)
    motion = Initial(radial_velocity=[1.0], origin=[3.0, 4.0]).about_axis(2)
    assert motion.origin == (3.0, 4.0) and motion.radial == (1.0,) and motion.axial == motion.angular == () and motion.length == 1.0
    assert Initial(velocity=[1.0, 0.0]).about_axis(2) is None
    assert Initial(axial_velocity=[1.0]).about_axis(3).axis == (0.0, 0.0, 1.0)


@pytest.mark.parametrize("table, dim, words", [
    ({"velocity": [1.0, 0.0, 0.0], "axis": [0.0, 0.0, 1.0]}, 3, "axis = .*none without radial_velocity"),
    ({"velocity": [1.0, 0.0], "length": 2.0}, 2, "length = 2.0"),
    ({"radial_velocity": [1.0], "axis": [0.0, 0.0, 0.0]}, 3, "not zero"),
    ({"radial_velocity": [1.0], "axis": [0.0, 1.0]}, 3, "3 components"),
    ({"radial_velocity": [1.0, 2.0]}, 2, "one number in 2D"),
    ({"axial_velocity": [1.0]}, 2, "axial_velocity = .*none in 2D"),
    ({"angular_velocity": [1.0], "axis": [0.0, 1.0]}, 2, "axis = .*none in 2D"),
    ({"angular_velocity": [1.0], "length": 1.0}, 2, "length = .*none in 2D"),
])
def test_impossible_axes(table, dim, words):
    with pytest.raises(Rule, match=words):
        Initial(**table).check(dim)
