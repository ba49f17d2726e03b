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
    assert contact_modulus(scene, material) == pytest.approx(expected / math.pi)
    assert contact_modulus(scene, material) == pytest.approx(15 * make_body(scene).law.micromodulus[0, 0])
    assert contact_distance(scene) == pytest.approx(1.35 * 0.5) and penalty(scene, scene.impactor[0], material) == pytest.approx(1 / 0.25)


def test_given_settings_are_taken():
    scene = scene_of("plane_stress", "[contact]\nstiffness = 7.0\ndistance = 0.4\n" + PLANE_TABLE + "stiffness = 3.0\n")
    assert contact_modulus(scene, None) == 7.0 and contact_distance(scene) == 0.4 and penalty(scene, scene.impactor[0], make_body(scene).materials[0]) == 3.0


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
