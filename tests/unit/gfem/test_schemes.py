import pytest

from pdhpc.gfem.schemes import NAMES, make_scheme


def test_every_scheme_has_its_name(pulled_plate, comm):
    assert NAMES == ("pinned", "galerkin", "instant", "literal")
    parts, _ = pulled_plate(comm, "pinned")
    for name in NAMES:
        scheme = make_scheme(name, parts.solution, parts.local, (1.0, 2), 0.05)
        assert (scheme.name, scheme.dt, scheme.k) == (name, 1.0, 2) and scheme.mass.failure is None
        assert name == "pinned" or scheme.tolerance == 0.05


def test_other_names_are_refused(pulled_plate, comm):
    parts, _ = pulled_plate(comm, "pinned")
    with pytest.raises(ValueError, match='"pined"; allowed is pinned, galerkin'):
        make_scheme("pined", parts.solution, parts.local, (1.0, 2), 0.05)
