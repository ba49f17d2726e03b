"""Settings that a scene leaves to the program, and the critical step with contact."""
import math

import numpy as np
import pytest

from pdhpc.conditions.impactors import CYLINDER, PLANE
from pdhpc.scene.body import make_body
from pdhpc.scene.interactions import contact_distance, contact_modulus, make_impactor, moduli_of, penalty
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import plate, problem_of

PLANE_TABLE = '[[impactor]]\nname = "p"\nshape = "plane"\npoint = [0.0, -9.0]\nnormal = [0.0, 4.0]\n'


def scene_of(dimension, extra="[contact]\n" + PLANE_TABLE, material=""):
    if dimension == "3d":
        extra = extra.replace("[0.0, -9.0]", "[0.0, -9.0, 0.0]").replace("[0.0, 4.0]", "[0.0, 4.0, 0.0]")
    return parse_scene(plate((6, 4, 4) if dimension == "3d" else (6, 4), 2.0, spacing=0.5, kinematics="finite", dimension=dimension, extra=extra, material=material), "t")


@pytest.mark.parametrize("dimension, expected", [("3d", 15 * 18 * (2 / 3)), ("plane_stress", 15 * 9), ("plane_strain", 15 * 48 / 5)])
def test_auto_is_fifteen_micromoduli_and_a_layer_of_material(dimension, expected):
    scene = scene_of(dimension)
    material = make_body(scene).materials[0]  # E = 1, horizon 1
    assert contact_modulus(scene, material, 1.0) == pytest.approx(expected / math.pi)
    assert contact_modulus(scene, material, 1.0) == pytest.approx(15 * make_body(scene).law.micromodulus[0, 0])
    assert contact_distance(scene, 0.5) == pytest.approx(1.35 * 0.5) and penalty(scene.impactor[0], material, 0.5) == pytest.approx(1 / 0.25)


def test_given_settings_are_taken():
    scene = scene_of("plane_stress", "[contact]\nstiffness = 7.0\ndistance = 0.4\n" + PLANE_TABLE + "stiffness = 3.0\n")
    assert contact_modulus(scene, None, 1.0) == 7.0 and contact_distance(scene, 0.5) == 0.4 and penalty(scene.impactor[0], make_body(scene).materials[0], 0.5) == 3.0


def test_moduli_of_either_model():
    young, bulk = moduli_of(make_body(scene_of("3d", material='model = "lps"\npoissons_ratio = 0.3')).materials[0])
    assert young == pytest.approx(1.0) and bulk == pytest.approx(1 / (3 * 0.4))
    assert moduli_of(make_body(scene_of("3d")).materials[0]) == pytest.approx((1.0, 2 / 3))


def test_contact_and_impactors_count_in_the_critical_step():
    alone = problem_of(plate((12, 8), kinematics="finite")).critical_dt
    pressed = problem_of(plate((12, 8), kinematics="finite", extra="[contact]\n" + PLANE_TABLE)).critical_dt
    pairs = 2 * 15 * 9 / (math.pi * 27) / 3  # 2 c_s V/horizon at E = V = rho = 1, horizon 3
    assert pressed == pytest.approx(math.sqrt(2 / (2 / alone**2 + pairs + 1.0)), rel=1e-12)


def test_interactions_of_a_scene():
    problem = problem_of(plate((6, 4), kinematics="finite", extra="[contact]\nfriction = 0.25\n" + PLANE_TABLE + 'mass = 2.0\n'))
    contact, impact = problem.stepper().conditions.interactions
    assert contact.law.friction == 0.25 and contact.law.dt == problem.dt and contact.resists and not contact.breaks
    assert contact.reach(np.array([4.0])) == pytest.approx([1.35 * 0.5 * 2.0]), "half the side of a cell of 2 x 2"
    assert impact.impactor.free and impact.sums is not None


def test_two_materials_repel_with_the_harmonic_mean():
    second = '[[material]]\nname = "stiff"\ndensity = 1.0\nyoungs_modulus = 3.0\n[[body]]\nname = "b"\nmaterial = "stiff"\nshape = "box"\nlower = [9.0, -2.0]\nupper = [12.0, 2.0]\n'
    contact = problem_of(plate((6, 4), kinematics="finite", extra=second + "[contact]\n")).stepper().conditions.interactions[0]
    table = contact.law.stiffness / contact.law.stiffness[0, 0]
    assert np.allclose(table, [[1.0, 1.5], [1.5, 3.0]])


def test_shapes_of_impactors():
    scene = scene_of("3d", '[[impactor]]\nname = "r"\nshape = "cylinder"\ncenter = [0.0, 0.0, 9.0]\nradius = 1.5\naxis = [0.0, 3.0, 4.0]\nlength = 5.0\n')
    rod = make_impactor(scene, scene.impactor[0])
    assert rod.kind == CYLINDER and rod.half_length == 2.5 and rod.radius == 1.5 and rod.axis == pytest.approx([0.0, 0.6, 0.8])
    scene = scene_of("plane_stress", PLANE_TABLE + '[[impactor]]\nname = "r"\nshape = "cylinder"\ncenter = [0.0, 9.0]\nradius = 1.5\n')
    plane, disk = (make_impactor(scene, table) for table in scene.impactor)
    assert plane.kind == PLANE and plane.axis.tolist() == [0.0, 1.0, 0.0] and disk.axis.tolist() == [0.0, 0.0, 1.0] and math.isinf(disk.half_length)


TABLE = """
[[body]]
name = "grain"
material = "solid"
shape = "table"
file = "{file}"
horizon = 2.5
[[interface]]
bodies = ["body", "grain"]
bonds = "none"
"""


def met(tmp_path, extra):
    """Return (problem, interactions) of a lattice's particle of side 1 at 0 and a table's of side 1/2 at 1.5, both with E = 1 and density 1."""
    (tmp_path / "grain.txt").write_text("1.5 0.0 0.25 1\n")
    text = plate((1, 1), kinematics="finite", extra=TABLE.format(file=tmp_path / "grain.txt") + extra)
    problem = problem_of(text, ["particles.volume_correction=none"])
    return problem, problem.stepper().conditions.interactions


def test_a_particle_of_a_table_against_one_of_a_lattice(tmp_path):
    """Their distance of contact is 1.35 (1/2 + 1/4) = 1.0125; brought to 0.9 they repel with c_s/horizon (1.0125 - 0.9) V_i V_j at the mean horizon, 2.75."""
    problem, (contact,) = met(tmp_path, "[contact]\n")
    particles = problem.subdomain.particles
    assert problem.subdomain.bonds.n_directed == 0 and sorted(particles.volume) == [0.25, 1.0]
    small = particles.slots[particles.owned(particles.volume) == 0.25][0]
    particles.displacement[small, 0] = -0.6
    particles.place()
    force = np.zeros_like(particles.force_density)
    contact.add_to(force, 0.0, 0)
    expected = 15 * 9 / (math.pi * 2.75**3) / 2.75 * (1.0125 - 0.9) * 0.25
    assert force[small, 0] * 0.25 == pytest.approx(expected, rel=1e-12) and np.abs((force * particles.volume[:, None]).sum(axis=0)).max() < 1e-16


def test_an_impactor_is_as_stiff_as_a_layer_of_what_it_meets(tmp_path):
    """A plane that enters a particle of side a by e pushes it with V E e/a^2: 1 at side 1, 4 times V at side 1/2."""
    problem, (impact,) = met(tmp_path, PLANE_TABLE)
    particles = problem.subdomain.particles
    particles.displacement[:, 1] -= 9.0
    particles.place()
    impact.watch.restart()
    force = np.zeros_like(particles.force_density)
    impact.add_to(force, 0.0, 0)
    by_volume = dict(zip(particles.volume, force[:, 1]))
    assert by_volume == {1.0: pytest.approx(0.5), 0.25: pytest.approx(4 * 0.25)}


def test_the_largest_particles_count_in_the_critical_step(tmp_path):
    """No bonds, so that contact alone counts: of the grain 2 c_s V/(horizon rho) with its own horizon 2.5 and V = 1/4, or V = 1 of the plate at 2.75."""
    problem, _ = met(tmp_path, "[contact]\n")
    modulus = lambda horizon: 15 * 9 / (math.pi * horizon**3) / horizon
    expected = max(modulus(2.5) * 0.25, modulus(2.75), modulus(3.0))
    assert problem.critical_dt == pytest.approx(math.sqrt(2 / (2 * expected)), rel=1e-9)


def test_bodies_nearer_than_the_distance_of_contact_store_nothing_at_the_start():
    """Centres 1.1 apart, below 1.35: they repel from 0.9 x 1.1 on, so that contact takes no energy from where it was drawn."""
    other = '[[body]]\nname = "b"\nmaterial = "solid"\nshape = "box"\nlower = [3.1, -2.0]\nupper = [6.1, 2.0]\n[[interface]]\nbodies = ["body", "b"]\nbonds = "none"\n'
    problem = problem_of(plate((6, 4), kinematics="finite", extra=other + "[contact]\n"))
    stepper, particles = problem.stepper(), problem.subdomain.particles
    force = np.zeros_like(particles.force_density)
    contact = stepper.conditions.interactions[0]
    contact.add_to(force, 0.0, 0)
    assert contact.near_pairs > 0 and not force.any() and not contact.ledger()["contact_energy"].any()
    particles.displacement[particles.slots[particles.owned(particles.reference)[:, 0] > 3.0], 0] = -0.2
    particles.place()
    contact.add_to(force, 0.0, 0)
    assert force.any(), "pressed to 0.9, it does"
