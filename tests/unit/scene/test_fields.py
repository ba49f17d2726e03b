import math

import pytest
from pydantic import TypeAdapter, ValidationError

from pdhpc.scene import fields
from pdhpc.scene.fields import Rule, check_direction, check_vector, free_or_number, length, printable, show


def test_vectors():
    check_vector("v", None, 2)
    check_vector("v", [1.0, 2.0], 2)
    with pytest.raises(Rule, match="3 components.*allowed is 2 components"):
        check_vector("v", [1.0, 2.0, 3.0], 2)
    with pytest.raises(Rule, match="not zero"):
        check_direction("v", [0.0, 0.0], 2)
    assert length([3.0, 4.0]) == 5.0


def test_free_or_a_number():
    assert free_or_number("free") == "free" and free_or_number(3) == 3.0
    for value in ("fre", None, True, [1]):
        with pytest.raises(ValueError, match="free"):
            free_or_number(value)


@pytest.mark.parametrize("kind, good, bad", [
    ("Number", [0, -1.5, 1e60], ["1", True, None, math.nan, math.inf, 1e61, 1e-61, 10**400]),
    ("Positive", [1, 1e-60], [0, -1]),
    ("NotNegative", [0, 1], [-1e-3]),
    ("Share", [1, 0.1], [0, 1.1]),
    ("Fraction", [0.5], [0, 1]),
    ("Whole", [1, 10**6], [0, 10**6 + 1, 1.0, True]),
    ("Flag", [True, False], [0, "true"]),
    ("Text", ["", "déjà vu"], [1, "two\nlines", "\x1b[31m"]),
    ("Name", ["a", "A_1-b", "x" * 60], ["", "1a", "ä", "a b", "a\n", "x" * 61, 3]),
    ("Vector", [[1, 2.5]], [[], 1, [True], [[1]], {}]),
    ("FreeVector", [["free", 1]], [["fre"], []]),
    ("Names", [[], ["a"]], ["a", [1]]),
    ("Matrix", [[[1, 2], [3, 4]]], [[], [1], [[]]]),
    ("AutoOrPositive", ["auto", 1e-9], ["Auto", 0, True, math.inf]),
])
def test_kinds_take_what_they_should(kind, good, bad):
    adapter = TypeAdapter(getattr(fields, kind))
    for value in good:
        assert adapter.validate_python(value) == value
    for value in bad:
        with pytest.raises(ValidationError):
            adapter.validate_python(value)


@pytest.mark.parametrize("value, text", [
    (True, "true"), ("a\nb", '"a\\nb"'), ([1, "x", [False]], '[1, "x", [false]]'), ({"a": 1}, "a table"), (1e-9, "1e-09"),
])
def test_values_are_shown_as_they_stand_in_a_scene(value, text):
    assert show(value) == text


def test_shown_values_are_short_and_printable():
    assert show(10**5000) == "a whole number of more than 60 digits"
    assert len(show("x" * 10_000)) == len(show([1.0] * 10_000)) == 60
    assert printable("a\x1b\udc80\u202eü") == "a\\x1b\\udc80\\u202eü"


def test_a_rule_says_what_was_found_and_what_is_allowed():
    rule = Rule("a.b", ["free", 1], "less")
    assert str(rule) == 'a.b = ["free", 1]; allowed is less' and rule.key == "a.b"
