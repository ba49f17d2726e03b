import pytest

from pdhpc.scene.overrides import BadOverride, apply


def scene():
    return {"time": {"end": 1.0}, "load": [{"name": "pull", "value": [0, 1]}, {"value": [2, 3]}]}


@pytest.mark.parametrize("override, path, value", [
    ("time.end=2.5", ("time", "end"), 2.5),
    (" time . end = 2 ", ("time", "end"), 2),
    ("load.pull.value=[3, 4]", ("load", 0, "value"), [3, 4]),
    ("load.1.value=[3, 4]", ("load", 1, "value"), [3, 4]),
    ("load[1].value=[3, 4]", ("load", 1, "value"), [3, 4]),
    (" load[ 1 ].value [0] = 7", ("load", 1, "value", 0), 7),
    ("load[0].time.function=ramp", ("load", 0, "time", "function"), "ramp"),
    ("load.pull.face=a[1]", ("load", 0, "face"), "a[1]"),
    ("load.pull.value.1=free", ("load", 0, "value", 1), "free"),
    ("load.pull={type = \"gravity\"}", ("load", 0), {"type": "gravity"}),
    ("load.pull.time.function=ramp", ("load", 0, "time", "function"), "ramp"),  # a missing table is made
    ("output.pictures=false", ("output", "pictures"), False),
    ("title=Hello, wörld = 3", ("title",), "Hello, wörld = 3"),
    ("title=", ("title",), ""),
    ('title="1"', ("title",), "1"),
    ("load.pull.face=+y", ("load", 0, "face"), "+y"),
    ("dimension=3d", ("dimension",), "3d"),
    ("time.end=inf", ("time", "end"), float("inf")),
])
def test_overrides_set_values(override, path, value):
    data = scene()
    assert apply(data, override) == path
    for step in path:
        data = data[step]
    assert data == value and type(data) is type(value)


@pytest.mark.parametrize("override, words", [
    ("time.end", "section.key=value"), ("=3", "section.key=value"), ("..=1", "section.key=value"), ("time..end=1", "section.key=value"),
    ("load.pul.value=1", 'load has no entry "pul"; allowed is an index below 2 or one of pull (did you mean "pull"?)'),
    ("load.2.value=1", "an index below 2"), ("load.-1.value=1", "an index below 2"), ("load.\u00b2.value=1", "an index below 2"), ("load.pull.value.5=1", "an index below 2"),
    ("load[-1].value=1", "whole number of at least 0"), ("load[x].value=1", "load[1]"), ("load[2].value=1", "an index below 2"),
    ("curve.0.x=a", "the scene has no [[curve]]"),
    ("time.end.deep=1", "time.end holds no keys"),
    ("time.end=[1", "[1 is not a TOML value"), ('title="a', "is not a TOML value"), ("time.end=1\ntitle=2", "is not a TOML value"),
    ("title=\udc80", "UTF-8"),
])
def test_bad_overrides_say_where_they_come_from(override, words):
    with pytest.raises(BadOverride) as caught:
        apply(scene(), override)
    text = str(caught.value)
    assert text.startswith("--set ") and "; allowed is " in text and words in text and text.isprintable(), text
