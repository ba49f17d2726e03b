"""Eight particles of one material, and of several."""
import numpy as np
import pytest

from pdhpc.kernels.family import MIXED
from pdhpc.warm_up import MODELS
from tests.unit.kernels.test_lattice import evaluated

BESIDE = '[[material]]\nname = "other"\ndensity = 1.0\nyoungs_modulus = {modulus}\n{more}[[body]]\nname = "beside"\nmaterial = "other"\nshape = "box"\nlower = [10.5, -6.5]\nupper = [20.5, 6.5]\n'


@pytest.mark.parametrize("model", MODELS)
def test_blocks_of_several_materials_that_are_alike_have_the_bits_of_one(model):
    """The same numbers under two names: the blocks at the border look each bond's material up, and find the same."""
    more = 'model = "lps"\npoissons_ratio = 0.1\n' if model == "lps" else ""
    two, _ = evaluated((21, 13), model, extra=BESIDE.format(modulus=1.0, more=more))
    body = '[[body]]\nname = "beside"\nmaterial = "solid"\nshape = "box"\nlower = [10.5, -6.5]\nupper = [20.5, 6.5]\n'
    one, _ = evaluated((21, 13), model, extra=body)
    assert np.any(two.bonds.arrays.kind[np.concatenate(two.rows) >> 3] == MIXED) and np.all(one.bonds.arrays.kind[np.concatenate(one.rows) >> 3] == 0)
    forces = [each.particles.owned(each.particles.force_density) for each in (two, one)]
    assert np.array_equal(*forces) and np.abs(forces[0]).max() > 0
