from types import SimpleNamespace

import pytest

from pdhpc.scene.fields import Rule
from pdhpc.scene.sections import named, reference, section, within

PULL, NAMELESS = SimpleNamespace(name="pull"), SimpleNamespace(name=None)


def test_tables_are_called_by_their_name_or_number():
    assert section("load", 2, PULL) == "load 'pull'" and section("load", 2, NAMELESS) == "load[2]"


def test_a_check_within_a_section_names_it():
    def fail():
        raise Rule("radius", 0, "more")

    with pytest.raises(Rule, match="body 'b': radius = 0; allowed is more"):
        within("body 'b'", fail)


def test_names_are_there_once_and_references_lead_somewhere():
    named([PULL, NAMELESS, NAMELESS], "load")
    with pytest.raises(Rule, match=r'load\[1\]: name = "pull", which load\[0\] has too'):
        named([PULL, PULL], "load")
    reference("a", "top", ["top", "left"], "region")
    with pytest.raises(Rule, match=r'a = "tpo"; allowed is the name of a region \(left, top\) \(did you mean "top"\?\)'):
        reference("a", "tpo", ["top", "left"], "region")
