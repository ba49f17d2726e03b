import numpy as np
import pytest

from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from pdhpc.study import estimate as module
from pdhpc.study.estimate import family_size, estimate
from pdhpc.study.verify.bodies import cracked, write_cells, write_table
from pdhpc.study.verify.case import plate, problem_of
from pdhpc.study.verify.static import METHODS, still
from pdhpc.warm_up import PATHS
from tests.unit.peridynamics.test_relaxation import STRETCH

NO_FAIL = '[[region]]\nname = "part"\nshape = "half_space"\npoint = [{x}, 0.0]\nnormal = [1.0, 0.0]\n[damage]\nno_fail = ["part"]\n'


def testfamily_sizes_of_known_lattices():
    assert family_size(3, 3.0 + 1e-9) == 122 and family_size(2, 3.0 + 1e-9) == 28 and family_size(2, 1.5) == 8


CHOICES = [[f"particles.path={path}", *model] for path in PATHS for model in ([], ["material.solid.model=lps", "material.solid.poissons_ratio=0.2"])]


@pytest.mark.parametrize("overrides", CHOICES, ids=lambda overrides: " ".join(overrides))
def test_a_small_scene_is_counted(overrides):
    text = plate((30, 20))
    found, problem = estimate(parse_scene(text, "t", overrides), 3), problem_of(text, overrides)
    assert found.path == problem.body.path and found.path.startswith(overrides[0].split("=")[1])
    assert found.exact and found.particles == 600 and found.bonds == problem.subdomain.bonds.n_directed // 2
    assert found.critical_dt == problem.critical_dt and found.steps == problem.n_steps and found.ranks == 3
    assert found.rate > 1e5 and 0 < found.memory < 1e6


@pytest.mark.parametrize("dimension, cells", [("plane_stress", (60, 50)), ("3d", (16, 15, 14))])
@pytest.mark.parametrize("overrides", CHOICES, ids=lambda overrides: " ".join(overrides))
def test_a_large_scene_is_estimated_close_to_what_it_is(monkeypatch, dimension, cells, overrides):
    scene = parse_scene(plate(cells, dimension=dimension), "t", overrides)
    exact = estimate(scene)
    monkeypatch.setattr(module, "_SMALL", 0)
    monkeypatch.setattr(module, "_SLAB_POINTS", 500)
    rough = estimate(scene)
    assert not rough.exact and rough.particles == exact.particles == int(np.prod(cells))
    assert exact.bonds < rough.bonds < 1.4 * exact.bonds
    assert rough.critical_dt == pytest.approx(exact.critical_dt, rel=0.02)


@pytest.mark.parametrize("small", [1e9, 0])
def test_a_region_without_particles_is_found_either_way(monkeypatch, small):
    monkeypatch.setattr(module, "_SMALL", small)
    assert estimate(parse_scene(plate((30, 20), extra=NO_FAIL.format(x=0.0)), "t")).particles == 600
    with pytest.raises(SceneError, match='"part", which selects no particle'):
        estimate(parse_scene(plate((30, 20), extra=NO_FAIL.format(x=14.9)), "t"))


OTHER = '[[body]]\nname = "other"\nmaterial = "solid"\nshape = "box"\nlower = [15.0, -10.0]\nupper = [30.0, 10.0]\nhorizon = 4.0\n'


def test_horizons_corrections_and_laws_count(monkeypatch):
    """Both horizons in bonds, step and critical stretch; 8 bytes a bond for corrections and 8 a particle for softening."""
    text = plate((30, 20), extra=OTHER, material="energy_release_rate = 1e-3")
    plain = estimate(parse_scene(text, "t"))
    assert plain.path.startswith("cloud") and [name for name, _ in plain.critical_stretch] == ["solid", "solid"]
    monkeypatch.setattr(module, "_SMALL", 0)
    rough = estimate(parse_scene(text, "t"))
    assert rough.particles == 900 and plain.bonds < rough.bonds < 1.4 * plain.bonds
    assert rough.critical_dt == pytest.approx(plain.critical_dt, rel=0.03)
    corrected = estimate(parse_scene(text, "t", ["particles.surface_correction=energy"]))
    softened = estimate(parse_scene(text, "t", ["material.solid.stretch_softening=0.25"]))
    scattered = estimate(parse_scene(text, "t", ["material.solid.weibull_modulus=5"]))
    assert scattered.memory == softened.memory and scattered.critical_dt == rough.critical_dt
    assert all(words.endswith("the mean of a Weibull distribution of modulus 5") for _, words in scattered.critical_stretch)
    slots = np.ceil(rough.neighbours / 8) * 8
    assert corrected.memory == pytest.approx(rough.memory + 900 * 8 * slots) and softened.memory == pytest.approx(rough.memory + 900 * 8)
    by_energy = estimate(parse_scene(text, "t", ["material.solid.failure=energy"])).critical_stretch
    assert len(by_energy) == 2 and "3 G/(2 t delta^3)" in by_energy[0][1] and f"w = {1.5e-3 / 27:.6g} " in by_energy[0][1]


@pytest.mark.parametrize("kind", ["table", "mesh"])
def test_bodies_from_files(monkeypatch, kind, tmp_path):
    counts, path = (30, 20), tmp_path / "points.inp"
    write_table(path, cracked(counts)) if kind == "table" else write_cells(path, counts)
    group = "2" if kind == "table" else "right"
    scene = parse_scene(cracked(counts, f'shape = "{kind}"\nfile = "{path}"', f'shape = "group"\ngroup = "{group}"'), "t")
    whole, exact = estimate(parse_scene(cracked(counts), "t"), 2), estimate(scene, 2)
    assert exact.exact and (exact.particles, exact.bonds, exact.steps, exact.critical_dt) == (whole.particles, whole.bonds, whole.steps, whole.critical_dt)
    assert exact.memory - whole.memory == (300 * 80 + (600 * 430 if kind == "mesh" else 0)), "points at home and in use; on rank 0 the mesh"
    monkeypatch.setattr(module, "_SMALL", 0)
    rough = estimate(scene, 2)
    assert not rough.exact and rough.particles == 600 and rough.bonds == estimate(parse_scene(cracked(counts), "t"), 2).bonds
    assert rough.critical_dt == pytest.approx(exact.critical_dt, rel=0.02)


PRESS = '[contact]\nfriction = 0.2\n[[impactor]]\nname = "p"\nshape = "plane"\npoint = [0.0, -99.0]\nnormal = [0.0, 1.0]\n'


@pytest.mark.parametrize("small", [1e9, 0])
def test_contact_and_impactors_count(monkeypatch, small):
    monkeypatch.setattr(module, "_SMALL", small)
    text = plate((30, 20), kinematics="finite")
    without, found = estimate(parse_scene(text, "t")), estimate(parse_scene(text + PRESS, "t"))
    assert found.critical_dt < 0.9 * without.critical_dt and found.steps >= without.steps and found.memory > 1.3 * without.memory
    assert [name for name, _ in found.contact] == ["contact distance", "contact stiffness", "impactor stiffness"] and without.contact == []
    assert found.contact[0][1] == "1.35 m = 1.35 spacing" and "15 times 9 E/(pi thickness horizon^3)" in found.contact[1][1] and "= E/spacing^2" in found.contact[2][1]


@pytest.mark.parametrize("dimension, cells", [("plane_stress", (100, 80)), ("3d", (20, 20, 20))])
@pytest.mark.parametrize("material, contact", [("", ""), ("critical_stretch = 0.1", "friction = 0.2\n")])
def test_memory_of_contact_is_what_it_takes(dimension, cells, material, contact):
    """What numpy holds at most while contact and its list are made, against the estimate."""
    import tracemalloc

    text = plate(cells, kinematics="finite", material=material, dimension=dimension) + "[contact]\n" + contact
    problem = problem_of(text)
    problem.stepper()  # compiles
    tracemalloc.start()
    problem.stepper().conditions.interactions[0]._make_list()
    peak = tracemalloc.get_traced_memory()[1] / np.prod(cells)
    tracemalloc.stop()
    assert peak / module._contact_bytes(parse_scene(text, "t")) == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize("small", [1e9, 0])
@pytest.mark.parametrize("method", METHODS)
def test_equilibria_are_estimated_without_a_critical_step(monkeypatch, method, small):
    """Within a factor of 4 of the evaluations that a stretch takes, whether the body is built or not."""
    monkeypatch.setattr(module, "_SMALL", small)
    text = still((60, 12), method, extra=STRETCH, tolerance=1e-6, steps=5)
    found, stepper = estimate(parse_scene(text, "t")), problem_of(text).stepper()
    stepper.advance()
    taken = stepper.internal.bond_evaluations / stepper.subdomain.bonds.n_directed + stepper.ksp_iterations
    assert taken / 4 < found.evaluations < 4 * taken
    assert found.steps == 5 and found.dt == pytest.approx(0.2) and found.seconds > 0 and not found.regions
    assert found.memory > estimate(parse_scene(text, "t", ["time.method=single"])).memory


@pytest.mark.parametrize("small", [True, False])
def test_bodies_and_remarks_whether_it_builds_or_samples(small, monkeypatch):
    """The disk of radius 1.9 holds 12 cells of 1 x 1, 5.8 % more than its area."""
    if not small:
        monkeypatch.setattr(module, "_SMALL", 0)
    disk = '[[body]]\nname = "d"\nmaterial = "solid"\nshape = "disk"\ncenter = [20.0, 0.0]\nradius = 1.9\n'
    found = module.estimate(parse_scene(plate((12, 10), extra=disk), "t"), 1)
    assert [each[:4] for each in found.bodies] == [("body", 120, 120.0, 120.0), ("d", 12, 12.0, 12.0)] and found.particles == 132
    assert len(found.warnings) == 1 and "body 'd': its 12 particles" in found.warnings[0]
