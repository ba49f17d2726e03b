import numpy as np

from pdhpc.warm_up import block, compile_kernels


def test_blocks():
    subdomain, law = block(3, 7, 3.0)
    assert subdomain.particles.n_owned == 343 and subdomain.bonds.family_size.max() == 122
    assert block(2, 5, 2.0, True)[0].particles.linear and np.isinf(law.critical_stretch).sum() == 0


def test_all_kernels_compile():
    compile_kernels()
