import pytest

from pdhpc.scene.read import parse_scene
from pdhpc.scene.schema import SceneError
from pdhpc.study.verify.case import plate

SECOND = '[[body]]\nname = "other"\nmaterial = "solid"\nshape = "box"\nlower = [20.0, -20.0]\nupper = [40.0, 20.0]\n'
FINE = '[fine]\nshape = "box"\nlower = [-5.0, -5.0]\nupper = [5.0, 5.0]\n'
GFEM = "[mesh]\ncell_size = 5.0\n"
BREAKS = ["material.solid.critical_stretch=0.1"]
LPS = ["material.solid.model=lps", "material.solid.poissons_ratio=0.3"]


def check(extra="", overrides=()):
    return parse_scene(plate(extra=extra), "f", overrides)


def interface(bodies, bonds="none"):
    return f'[[interface]]\nbodies = {bodies}\nbonds = "{bonds}"\n'


def test_what_is_allowed():
    check(SECOND + interface('["body", "other"]'), ["body.other.horizon=5.0"])
    check(FINE + SECOND + interface('["body", "other"]', "glued"), ["body.other.horizon=3.0"])
    check("", ["material.solid.energy_release_rate=1.0", "material.solid.failure=energy", "particles.surface_correction=energy"])
    check("", ["material.solid.critical_stretch=0.1", "material.solid.stretch_softening=0.25", *LPS])
    check("", ["particles.influence=conical", "particles.surface_correction=energy"])
    check("", ["material.solid.critical_stretch=0.1", "material.solid.weibull_modulus=10", "material.solid.weibull_length=3.0", "material.solid.weibull_seed=2", *LPS])


@pytest.mark.parametrize("extra, overrides, words", [
    ("", ["material.solid.failure=energy"], ["energy_release_rate = nothing", 'failure = "energy" needs it']),
    ("", ["material.solid.failure=energy", "material.solid.critical_stretch=0.1"], ["energy_release_rate = nothing", 'failure = "energy" needs it']),
    ("", ["material.solid.failure=work"], ['failure = "work"', '"stretch", "energy"']),
    ("", ["material.solid.failure=energy", "material.solid.energy_release_rate=1.0", "material.solid.stretch_softening=0.25"], ["stretch_softening = 0.25", "no critical stretch"]),
    ("", ["material.solid.stretch_softening=0.25"], ["bonds that never break"]),
    ("", ["material.solid.stretch_softening=-0.25", "material.solid.critical_stretch=0.1"], ["at least 0"]),
    ('[[material]]\nname = "m"\ndensity = 1.0\nyoungs_modulus = 1.0\nfailure = "energy"\nenergy_release_rate = 1.0\n' + SECOND, ["body.other.material=m"], ["material 'm': failure", "share one"]),
    ("", ["material.solid.weibull_modulus=10"], ["weibull_modulus = 10.0 of bonds that never break"]),
    ("", ["material.solid.weibull_modulus=0.5", *BREAKS], ["weibull_modulus = 0.5", "1 to 1000"]),
    ("", ["material.solid.weibull_length=3.0", *BREAKS], ["weibull_length = 3.0", "a weibull_modulus beside it"]),
    ("", ["material.solid.weibull_seed=3", *BREAKS], ["weibull_seed = 3", "a weibull_modulus beside it"]),
    ("", ["material.solid.weibull_seed=-3", "material.solid.weibull_modulus=10", *BREAKS], ["weibull_seed = -3", "whole number from 1"]),
    ("", ["material.solid.weibull_modulus=10", "material.solid.failure=energy", "material.solid.energy_release_rate=1.0"], ['with failure = "energy"', "none there"]),
    ("", ["material.solid.weibull_modulus=10", "material.solid.stretch_softening=0.25", *BREAKS], ["stretch_softening = 0.25 beside the weibull_modulus of material 'solid'"]),
    (FINE, ["material.solid.weibull_modulus=10", *BREAKS], ["weibull_modulus = 10.0 with a table [fine]", "none there"]),
    (GFEM, ["model=gfem", "material.solid.weibull_modulus=10", *BREAKS], ['with model = "gfem"', "none there"]),
    (SECOND, ["body.other.horizon=1.5"], ["body 'other': horizon = 1.5", "2 to 100 spacings"]),
    (SECOND, ["body.other.horizon=101.0"], ["2 to 100 spacings"]),
    (SECOND + interface('["body", "body"]'), [], ["two different bodies"]),
    (SECOND + interface('["body"]'), [], ["two different bodies"]),
    (SECOND + interface('["body", "othr"]'), [], ['"othr"', 'did you mean "other"']),
    (SECOND + interface('["body", "other"]') + interface('["other", "body"]'), [], ["interface[1]: bodies", "interface[0] has it too"]),
    (SECOND + interface('["body", "other"]', "welded"), [], ['"glued", "none"']),
    ("", ["particles.surface_correction=energy", *LPS], ['"none" with model = "lps"', "weighted volumes"]),
    ("", ["particles.influence=conical", "particles.surface_correction=volume"], ['"volume" with influence = "conical"', 'allowed is "energy"']),
    (FINE, ["particles.surface_correction=energy"], ["surface_correction", "with a table [fine]"]),
    (FINE, ["material.solid.energy_release_rate=1.0", "material.solid.failure=energy"], ['"stretch" there']),
    (FINE, ["material.solid.critical_stretch=0.1", "material.solid.stretch_softening=0.25"], ["0 there"]),
    (FINE + SECOND, ["body.other.horizon=4.0"], ["that of [particles] there, 3 m"]),
    (FINE + SECOND + interface('["body", "other"]'), [], ['"glued" there']),
    (GFEM, ["model=gfem", "particles.surface_correction=volume"], ["surface_correction", 'with model = "gfem"']),
    (GFEM, ["model=gfem", "material.solid.critical_stretch=0.1", "material.solid.stretch_softening=0.25"], ["0 there"]),
    (GFEM, ["model=gfem", "body.body.horizon=3.0"], ["no such key", 'model = "gfem"']),
    (GFEM + SECOND + interface('["body", "other"]', "glued"), ["model=fem"], ["interface[0] = a table", "share their vertices"]),
    (SECOND, ["body.other.horizon=4.0", "particles.path=lattice"], ['"lattice" although horizons of bodies differ']),
    ("", ["particles.surface_correction=energy", "particles.path=lattice"], ['"lattice" although each bond has its own surface correction']),
    ("", ["material.solid.energy_release_rate=1.0", "material.solid.failure=energy", "particles.path=lattice", *LPS], ["bonds of lps break by their energy"]),
])
def test_broken_rules_in_one_sentence(extra, overrides, words):
    from pdhpc.scene.body import make_body

    with pytest.raises(SceneError) as error:
        make_body(check(extra, overrides))
    assert all(word in str(error.value) for word in words), str(error.value)
