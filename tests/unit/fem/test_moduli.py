import numpy as np
import pytest

from pdhpc.fem.moduli import checked, isotropic


def test_uniaxial_stress_stretches_by_its_modulus():
    """A rod of stress sigma has the strains sigma/E along and -nu sigma/E across; in plane strain the rod is E/(1 - nu^2) stiff."""
    e, nu = 7.0, 0.3
    strain = np.linalg.solve(isotropic(e, nu, "3d"), [1, 0, 0, 0, 0, 0])
    assert strain == pytest.approx([1 / e, -nu / e, -nu / e, 0, 0, 0])
    assert np.linalg.solve(isotropic(e, nu, "plane_stress"), [1, 0, 0]) == pytest.approx([1 / e, -nu / e, 0])
    assert np.linalg.solve(isotropic(e, nu, "plane_strain"), [1, 0, 0])[0] == pytest.approx((1 - nu**2) / e)


@pytest.mark.parametrize("dimension", ("plane_stress", "plane_strain", "3d"))
def test_shear_has_the_shear_modulus(dimension):
    c = isotropic(2.6, 0.3, dimension)
    assert c[-1, -1] == pytest.approx(1.0) and np.array_equal(c, c.T)


def test_plane_strain_is_the_plane_of_three_dimensions():
    whole, rows = isotropic(5.0, 0.2, "3d"), [0, 1, 5]
    assert isotropic(5.0, 0.2, "plane_strain") == pytest.approx(whole[np.ix_(rows, rows)])


def test_what_has_no_positive_energy_is_refused():
    with pytest.raises(ValueError, match="nu = 0.5"):
        isotropic(1.0, 0.5, "plane_strain")
    with pytest.raises(ValueError, match="plane_stress"):
        isotropic(1.0, 0.3, "plane")
    with pytest.raises(ValueError, match="not symmetric"):
        checked([[1.0, 0.5, 0], [0, 1, 0], [0, 0, 1]], 2)
    with pytest.raises(ValueError, match="lowest eigenvalue is -1"):
        checked(np.diag([1.0, -1, 1]), 2)
    with pytest.raises(ValueError, match="3 x 3"):
        checked(np.eye(6), 2)
    assert checked(np.eye(6), 3).shape == (1, 6, 6)
