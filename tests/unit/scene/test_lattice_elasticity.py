import numpy as np
import pytest

from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import problem_of as particles_of
from tests.unit.scene.test_mesh_rules import FEM, LATTICE

LAMBDA = LATTICE[:1] + ['particles={spacing=0.1, horizon=0.3015, kinematics="linear"}']
STRAIN = '[[initial]]\ndisplacement_gradient = [[1e-3, 2e-4], [0.0, -5e-4]]\n'


def test_moduli_are_those_of_the_bonds(comm):
    """Uniform strain: elements store what the bonds of the same lattice store, edges included; the continuum does not."""
    lattice, continuum = (build(parse_scene(FEM + STRAIN, "t", overrides), comm) for overrides in (LAMBDA, []))
    energies = [problem.stepper().ledger()["strain_energy"].sum() for problem in (lattice, continuum)]
    bonds = particles_of((FEM + STRAIN), ["model=particles", *LAMBDA[1:]])
    exact = bonds.stepper().ledger()["strain_energy"].sum()
    assert energies[0] == pytest.approx(exact, rel=1e-9) and abs(energies[1] / exact - 1) > 0.01
    assert lattice.elasticity.lumped_mass(lattice.nodes.stars).sum() == pytest.approx(50.0) and np.allclose(lattice.elasticity.density, 1.0)


def test_interior_moduli_have_the_anisotropy_of_the_lattice(comm):
    """C11 : C12 of a square lattice, horizon 3.015 h, linear volume ramp: 1.1394 : 0.3606, C12 = C66 (central forces)."""
    problem = build(parse_scene(FEM, "t", LAMBDA), comm)
    middle = problem.elasticity.moduli[problem.elasticity.kind[problem.body.mesh.n_owned_cells // 2 + 5]]
    assert middle[0, 1] == pytest.approx(middle[2, 2]) and middle[0, 0] / middle[0, 1] == pytest.approx(1.1394 / 0.3606, rel=1e-3)
    assert middle[0, 0] == pytest.approx(middle[1, 1]) and abs(middle[0, 2]) < 1e-12
