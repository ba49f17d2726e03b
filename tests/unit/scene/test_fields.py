import pytest

from pdhpc.scene.fields import Rule, check_direction, check_vector, free_or_number, length


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
