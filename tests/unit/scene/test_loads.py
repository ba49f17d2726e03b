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
        LOAD.validate_python({"type": "traction", "region": "r", "value": [0.0, 1.0]})  # no face


def test_time_functions():
    assert TIME.validate_python({"function": "sine", "frequency": 2.0}).phase == 0.0
    with pytest.raises(Rule, match="after time.start"):
        TIME.validate_python({"function": "ramp", "start": 2.0, "end": 1.0}).check(2)


def test_initial_states():
    Initial(velocity=[1.0, 0.0]).check(2)
    with pytest.raises(Rule, match="at least one of"):
        Initial(region="r").check(2)
