import numpy as np

from pdhpc.parallel.noise import noise


def test_noise_depends_on_ids_alone():
    whole = noise(np.arange(1000), 3)
    assert np.array_equal(noise(np.arange(10, 20), 3), whole[10:20]) and np.abs(whole).max() <= 1 and abs(whole.mean()) < 0.05 and 0.5 < whole.std() < 0.65
