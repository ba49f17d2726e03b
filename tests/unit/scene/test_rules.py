import pytest

from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError

BASE = """
dimension = "plane_stress"
[particles]
spacing = 0.5
horizon = 1.5
[[material]]
name = "m"
density = 1.0
youngs_modulus = 1.0
[[body]]
name = "b"
material = "m"
shape = "box"
lower = [0.0, 0.0]
upper = [10.0, 5.0]
[time]
end = 1.0
"""
BASE_3D = BASE.replace("plane_stress", "3d").replace("0.0, 0.0]", "0.0, 0.0, 0.0]").replace("10.0, 5.0]", "10.0, 5.0, 2.0]")
REGION = '[[region]]\nname = "r"\nshape = "box"\nlower = [0.0, 0.0]\nupper = [1.0, 1.0]\n'
LOAD = '[[load]]\nname = "l"\ntype = "displacement"\nregion = "r"\nvalue = [0.0, "free"]\n'


def check(extra="", *overrides, base=BASE):
    return parse_scene(base + extra, "f", overrides)


def test_the_bases_are_valid():
    check()
    check(base=BASE_3D)
    check(REGION + LOAD)


@pytest.mark.parametrize("extra, overrides, words", [
    ("", ["output.fields=['fragment']"], ["output.fields", "without a table [fragments]"]),
    ("[fine]\nshape = 'box'\nlower = [0.0, 0.0]\nupper = [2.0, 2.0]\n[fragments]\n", [], ["fragments", 'time.method = "mts"', "one step for the whole body"]),
    ("[fragments]\ndamage = 1.5\n", [], ["fragments", "damage"]),
    ("", ["particles.horizon=0.9"], ["--set particles.horizon=0.9: particles.horizon = 0.9", "at least 2 spacings, 1 m"]),
    ("", ["particles.horizon=500.0"], ["at most 100 spacings"]),
    ("", ["particles.path=grid"], ['particles.path = "grid"', '"auto", "lattice", "cloud"']),
    ("", ["material.m.model=lsp"], ['model = "lsp"', 'did you mean "lps"']),
    ("", ["material.m.poissons_ratio=0.2"], ["poissons_ratio = 0.2", "1/3", "bond-based"]),
    ("", ["material.m.energy_release_rate=1.0", "material.m.critical_stretch=0.1"], ["not both"]),
    ("", ["body.b.material=wood"], ['material = "wood"', "(m)"]),
    ('[[material]]\nname = "spare"\ndensity = 1.0\nyoungs_modulus = 1.0\n', [], ["'spare'", "which no body uses"]),
    ('[[material]]\nname = "m"\ndensity = 1.0\nyoungs_modulus = 1.0\n', [], ["no other material has"]),
    ("", ["body.b.upper=[10.2, 5.0]"], ["whole number of spacings", "nearest is 10 m"]),
    ("", ["body.b.upper=[-1.0, 5.0]"], ["upper", "above lower"]),
    ("", ["body.b.upper=[10.0]"], ["1 components", "2 components"]),
    ("", ["body.b.upper=[1e40, 5.0]"], ["reaches to 1e+40 m", "within 1e9 spacings"]),
    ('[[body]]\nname = "c"\nmaterial = "m"\nshape = "box"\nlower = [9.5, 0.0]\nupper = [12.0, 5.0]\n', [], ["does not overlap", "body 'b'"]),
    ('[[body]]\nname = "c"\nmaterial = "m"\nshape = "sphere"\ncenter = [20.0, 0.0]\nradius = 1.0\n', [], ['"sphere"', "2D"]),
    ("", ['body.b.hole=[{shape="disk", center=[50.0, 0.0], radius=1.0}]'], ["hole[0]", "meets its body"]),
    (REGION, [], ["region 'r'", "which nothing uses"]),
    (REGION.replace('"r"', '"all"'), [], ["all is built in"]),
    (REGION.replace("[1.0, 1.0]", "[-1.0, 1.0]"), [], ["above lower"]),
    (REGION.replace("[0.0, 0.0]", "[90.0, 0.0]").replace("[1.0, 1.0]", "[91.0, 1.0]") + LOAD, [], ["selects no particle"]),
    (REGION + LOAD, ["load.l.region=rr"], ['region = "rr"', 'did you mean "r"']),
    (REGION + LOAD, ['region.r.body="bb"'], ['body = "bb"', 'did you mean "b"']),
    (REGION + LOAD, ['load.l.value=["free", "free"]'], ["at least one component"]),
    (REGION + LOAD + LOAD.replace('"l"', '"k"'), [], ["load 'l' prescribes"]),
    (REGION + LOAD + LOAD, [], ["no other load has"]),
    ('[[load]]\ntype = "traction"\nregion = "all"\nface = "+z"\nvalue = [0.0, 1.0]\n', [], ["+z", "2D"]),
    ('[[load]]\ntype = "gravity"\nvalue = [0.0, 1.0]\ntime = { function = "ramp", start = 2.0, end = 1.0 }\n', [], ["after time.start"]),
    ('[[load]]\ntype = "gravity"\nvalue = [0.0, 1.0]\ntime = { function = "table", times = [0.0, 0.0], values = [1.0, 2.0] }\n', [], ["each after the one before"]),
    ('[[load]]\ntype = "gravity"\nvalue = [0.0, 1.0]\ntime = { function = "table", times = [0.0, 1.0], values = [1.0] }\n', [], ["as many values as times"]),
    ('[[initial]]\nregion = "all"\n', [], ["nothing", "velocity_gradient"]),
    ('[[initial]]\nvelocity_gradient = [[1.0, 0.0]]\n', [], ["2 rows of 2"]),
    ('[[crack]]\ntype = "polyline"\npoints = [[20.0, 0.0], [30.0, 0.0]]\n', [], ["outside every body"]),
    ('[[crack]]\ntype = "polyline"\npoints = [[2.0, 0.0], [2.0, 0.0]]\n', [], ["different from the one before"]),
    ('[[crack]]\ntype = "disk"\ncenter = [1.0, 1.0, 0.0]\nnormal = [0.0, 0.0, 1.0]\nradius = 1.0\n', [], ["polyline in 2D"]),
    ("", ["time.safety=1.5"], ["at most 1"]),
    ("", ["time.dt=2.0"], ["to time.end = 1 s"]),
    ("", ["output.every=0.1", "output.frames=3"], ["only one of every, frames and times"]),
    ("", ["output.times=[0.5, 2.0]"], ["output.times[1] = 2.0", "up to time.end"]),
    ("", ["output.every=1e-9"], ["an interval from"]),
    ("", ['output.fields=["damage", "damage"]'], ["each field once"]),
    ('[[probe]]\nname = "p"\nquantity = "stress"\n', [], ["exactly one of point and region"]),
    ('[[probe]]\nname = "p"\npoint = [1.0, 1.0]\nquantity = "reaction"\n', [], ["a region"]),
    ('[[probe]]\nname = "p"\npoint = [1.0, 1.0]\nquantity = "velocity"\n[[curve]]\nname = "c"\nx = "p.velocity_x"\ny = "p.velocity_z"\n', [], ["p.velocity_z", "did you mean"]),
    ('[[tip]]\nname = "t"\ndirection = [0.0, 0.0]\n[[tip]]\nname = "u"\n', [], ["not zero"]),
    ('[[tip]]\nname = "t"\nthreshold = 1.0\n', [], ["below 1"]),
    ('[[body]]\nname = "c"\nmaterial = "m"\nshape = "disk"\ncenter = [11.0, 2.5]\nradius = 1.5\n', [], ["body 'c': center = [11.0, 2.5]", "does not overlap body 'b'"]),
    ('[[body]]\nname = "b"\nmaterial = "m"\nshape = "disk"\ncenter = [21.0, 2.5]\nradius = 1.5\n', [], ["body[1]: name = \"b\"", "no other body has"]),
    ("", ["particles.spacing=1e-12", "particles.horizon=3e-12"], ["body 'b': shape", "within 1e9 spacings"]),
    ("", ["particles.spacing=1e-7", "particles.horizon=3e-7", "body.b.upper=[50.0, 50.0]"], ["particles.spacing = 1e-07", "2^53"]),
    (REGION + LOAD + REGION, [], ["region[1]: name = \"r\"", "no other region has"]),
    ('[[region]]\nname = "r"\nshape = "half_space"\npoint = [11.0, 0.0]\nnormal = [2.0, 0.0]\n' + LOAD, [], ["half_space", "outside every body"]),
    ('[[region]]\nname = "r"\nshape = "half_space"\npoint = [11.0, 0.0]\nnormal = [0.0, 0.0]\n' + LOAD, [], ["normal = [0.0, 0.0]", "not zero"]),
    (REGION.replace("[0.0, 0.0]", "[11.0, 0.0]").replace("[1.0, 1.0]", '[12.0, 1.0]\nbody = "b"') + LOAD
     + '[[body]]\nname = "c"\nmaterial = "m"\nshape = "box"\nlower = [10.0, 0.0]\nupper = [15.0, 5.0]\n', [], ["outside body 'b'"]),
    (REGION, ['damage.no_fail=["r", "r"]'], ['no_fail[1] = "r" again', "each region once"]),
    (REGION + LOAD + LOAD.replace('"l"', '"k"').replace("displacement", "velocity"), [], ["load 'k': value", '"free" in x']),
    (REGION + LOAD, ["load.l.value=[1.0]"], ["load 'l': value = [1.0] (1 components)", "2 components"]),
    ("", ["time.dt=1e-20"], ["time.dt = 1e-20", "a step from"]),
    ("", ["output.times=[0.5, 0.5]"], ["output.times[1] = 0.5", "times increase"]),
    ("", ["output.times=[0.0, 0.5]"], ["output.times[0] = 0.0", "after 0 s"]),
    ("", ["output.times=[0.5]", "output.every=0.5"], ["output.times = [0.5] beside output.every", "only one"]),
    ("", ["output.history_every=2.0"], ["history_every = 2.0", "up to time.end"]),
    ('[[probe]]\nname = "p"\nquantity = "stress"\npoint = [1.0, 1.0]\nregion = "all"\n', [], ["beside region", "exactly one"]),
    ('[[probe]]\nname = "p"\nquantity = "stress"\npoint = [12.0, 1.0]\n', [], ["probe 'p': point = [12.0, 1.0]", "within a horizon"]),
    ('[[probe]]\nname = "p"\nquantity = "stress"\npoint = [1.0]\n', [], ["2 components"]),
    ('[[probe]]\nname = "p"\nquantity = "stress"\npoint = [1.0, 1.0]\n' * 2, [], ["no other probe has"]),
    ('[[probe]]\nname = "p"\nquantity = "stress"\nregion = "al"\n', [], ["probe 'p': region = \"al\"", 'did you mean "all"']),
    ('[[curve]]\nname = "c"\nx = "p.velocity_x"\ny = "p.velocity_x"\n', [], ["curve 'c': x = \"p.velocity_x\"", "none is defined"]),
    ('[[probe]]\nname = "p"\nquantity = "damage"\npoint = [1.0, 1.0]\n[[tip]]\nname = "p"\n', [], ["tip 'p': name", "a name that no probe has"]),
    ('[[tip]]\nname = "t"\nwindow = 2.0\n', [], ["window = 2.0", "at most time.end"]),
    ('[[initial]]\nregion = "al"\nvelocity = [1.0, 0.0]\n', [], ["initial[0]: region = \"al\"", 'did you mean "all"']),
    ('[[tip]]\nname = "t"\nregion = "al"\n', [], ["tip 't': region = \"al\""]),
    ("", ['damage.no_fail=["x"]'], ['no_fail[0] = "x"', "region"]),
])
def test_each_rule_in_one_sentence(extra, overrides, words):
    with pytest.raises(SceneError) as caught:
        check(extra, *overrides)
    text = str(caught.value)
    assert text.startswith(("f: ", "f with --set ")) and "allowed is" in text and all(word in text for word in words), text


@pytest.mark.parametrize("extra, words", [
    ('[[crack]]\ntype = "rectangle"\ncorner = [0.0, 0.0, 1.0]\nedge1 = [1.0, 0.0, 0.0]\nedge2 = [2.0, 0.0, 0.0]\n', "not parallel"),
    ('[[crack]]\ntype = "polyline"\npoints = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]\n', "rectangle or disk in 3D"),
    ('[[region]]\nname = "r"\nshape = "disk"\ncenter = [0.0, 0.0, 0.0]\nradius = 1.0\n', "in 3D"),
    ("", "no thickness in 3D"),
])
def test_rules_of_three_dimensions(extra, words):
    with pytest.raises(SceneError, match=words):
        check(extra, *(["particles.thickness=1.0"] if not extra else []), base=BASE_3D)


@pytest.mark.parametrize("dimension, ratio", [("plane_stress", 0.333), ("plane_stress", 1 / 3), ("plane_strain", 0.25), ("3d", 0.25)])
def test_the_poissons_ratio_of_the_model_may_be_given(dimension, ratio):
    check("", f"dimension={dimension}", f"material.m.poissons_ratio={ratio}", base=BASE_3D if dimension == "3d" else BASE)


@pytest.mark.parametrize("dimension, words", [("plane_stress", "1/3"), ("plane_strain", "1/4"), ("3d", "1/4")])
def test_another_poissons_ratio_is_refused(dimension, words):
    with pytest.raises(SceneError, match=f"{words} .*bond-based"):
        check("", f"dimension={dimension}", "material.m.poissons_ratio=0.3", base=BASE_3D if dimension == "3d" else BASE)


def moduli(lines, model="lps", dimension="plane_stress"):
    """BASE with these lines in the place of Young's modulus."""
    base = (BASE_3D if dimension == "3d" else BASE).replace('"plane_stress"', f'"{dimension}"')
    assert "youngs_modulus = 1.0\n" in base
    return base.replace("youngs_modulus = 1.0\n", f'model = "{model}"\n{lines}')


E, NU, K, G = "youngs_modulus = 1.0\n", "poissons_ratio = 0.3\n", "bulk_modulus = 2.0\n", "shear_modulus = 1.0\n"


@pytest.mark.parametrize("dimension", ["plane_stress", "plane_strain", "3d"])
@pytest.mark.parametrize("lines", [E + NU, K + G, E + "poissons_ratio = -0.99\n", E + "poissons_ratio = 0.499\n", E + "poissons_ratio = 0.0\n"])
def test_a_linear_solid_has_either_pair_of_moduli(dimension, lines):
    material = check(base=moduli(lines, dimension=dimension)).material[0]
    assert (material.youngs_modulus is None) != (material.bulk_modulus is None)


@pytest.mark.parametrize("lines, words", [
    ("", "material 'm': youngs_modulus = nothing"),
    (E, "material 'm': poissons_ratio = nothing beside youngs_modulus"),
    (NU, "material 'm': youngs_modulus = nothing beside poissons_ratio"),
    (K, "material 'm': shear_modulus = nothing beside bulk_modulus"),
    (G, "material 'm': bulk_modulus = nothing beside shear_modulus"),
    (E + G, "beside youngs_modulus and shear_modulus"),
    (E + K, "beside youngs_modulus and bulk_modulus"),
    (NU + K, "beside poissons_ratio and bulk_modulus"),
    (E + NU + G, "beside youngs_modulus and poissons_ratio and shear_modulus"),
    (E + NU + K + G, "beside youngs_modulus and poissons_ratio and bulk_modulus and shear_modulus"),
])
def test_other_sets_of_moduli_are_refused(lines, words):
    with pytest.raises(SceneError) as caught:
        check(base=moduli(lines))
    assert words in str(caught.value) and 'allowed is youngs_modulus and poissons_ratio, or bulk_modulus and shear_modulus, for model = "lps"' in str(caught.value)


@pytest.mark.parametrize("nu", [0.5, -1.0, 0.6, -2.0])
def test_a_poissons_ratio_beyond_the_stable_ones_is_refused(nu):
    with pytest.raises(SceneError, match="poissons_ratio = .*allowed is a number above -1 and below 0.5"):
        check(base=moduli(E + f"poissons_ratio = {nu}\n"))


@pytest.mark.parametrize("lines, words", [
    (E + K, "bulk_modulus = 2.0; allowed is no such key in model = \"pmb\""), (E + G, "shear_modulus = 1.0; allowed is no such key in model = \"pmb\""),
    (K + G, "youngs_modulus = nothing; allowed is a number above 0, Pa: model = \"pmb\" needs it"), ("", "youngs_modulus = nothing"),
])
def test_a_bond_based_solid_has_youngs_modulus_alone(lines, words):
    with pytest.raises(SceneError) as caught:
        check(base=moduli(lines, "pmb"))
    assert f"material 'm': {words}" in str(caught.value)


def test_materials_of_one_scene_share_a_model():
    other = '[[material]]\nname = "n"\ndensity = 1.0\nyoungs_modulus = 1.0\n{more}[[body]]\nname = "c"\nmaterial = "n"\nshape = "box"\nlower = [10.0, 0.0]\nupper = [12.0, 5.0]\n'
    check(other.format(more='model = "lps"\npoissons_ratio = 0.1\n'), base=moduli(E + NU))
    with pytest.raises(SceneError, match="material 'n': model = \"pmb\"; allowed is \"lps\", the model of material 'm': all materials of a scene share one"):
        check(other.format(more=""), base=moduli(E + NU))


def test_box_sides_may_be_off_by_rounding_only():
    check("", "particles.spacing=0.1", "particles.horizon=0.3", "body.b.upper=[0.3, 0.7]")  # 0.3/0.1 and 0.7/0.1 are not whole in doubles
    check("", "body.b.lower=[1000.1, 0.0]", "body.b.upper=[1010.1, 5.0]")
    with pytest.raises(SceneError, match="nearest is 10 m"):
        check("", "body.b.upper=[10.00001, 5.0]")  # off by 2e-5 spacings


def test_a_default_window_longer_than_the_run_is_fine():
    check('[[tip]]\nname = "t"\n', "time.end=1e-7")


def test_the_same_component_on_other_regions_and_other_components_on_the_same_are_fine():
    other = LOAD.replace('"l"', '"k"')
    check(REGION + LOAD + other.replace('[0.0, "free"]', '["free", 0.0]'))
    check(REGION + REGION.replace('"r"', '"s"') + LOAD + other.replace('region = "r"', 'region = "s"'))


def test_touching_bodies_are_fine():
    check('[[body]]\nname = "c"\nmaterial = "m"\nshape = "box"\nlower = [10.0, 0.0]\nupper = [12.0, 5.0]\n')
