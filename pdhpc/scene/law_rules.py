"""Rules of material laws, corrections and bonds between bodies: what goes together, and what only bodies of particles at one step know; see rules.py."""
from pdhpc.scene.fields import Rule
from pdhpc.scene.sections import reference, section

_MOST_BLOCKS = 254  # numbers of blocks that a byte holds beside the marks of rows that differ


def check_laws(scene):
    """Raise a Rule for the first rule of damage laws, surface corrections, horizons and interfaces that the scene breaks."""
    for number, material in enumerate(scene.material):
        _check_failure(section("material", number, material), material, scene.material[0])
    _check_one_way(scene)
    _check_horizons(scene)
    _check_interfaces(scene)
    if scene.uses_lattice:
        _check_correction(scene)
        _check_company(scene)


def _check_failure(where, material, first):
    if material.failure != first.failure:
        raise Rule(f"{where}: failure", f'"{material.failure}"', f'"{first.failure}", as of material \'{first.name}\': all materials of a scene share one')
    if material.failure == "energy":
        if material.energy_release_rate is None:
            raise Rule(f"{where}: energy_release_rate", "nothing", 'a number above 0, J/m^2: failure = "energy" needs it')
        if material.stretch_softening > 0:
            raise Rule(f"{where}: stretch_softening", material.stretch_softening, '0 with failure = "energy", which knows no critical stretch to raise')
    elif material.stretch_softening > 0 and material.energy_release_rate is None and material.critical_stretch is None:
        raise Rule(f"{where}: stretch_softening", f"{material.stretch_softening} of bonds that never break", "0, or energy_release_rate or critical_stretch beside it")
    _check_scatter(where, material)


def _check_scatter(where, material):
    if material.weibull_modulus is None:
        for key in ("weibull_length", "weibull_seed"):
            if getattr(material, key) is not None:
                raise Rule(f"{where}: {key}", getattr(material, key), "a weibull_modulus beside it, or none")
        return
    if material.failure != "stretch":
        raise Rule(f"{where}: weibull_modulus", f'{material.weibull_modulus} with failure = "{material.failure}"', 'none there: it scatters the critical stretch of failure = "stretch"')
    if material.energy_release_rate is None and material.critical_stretch is None:
        raise Rule(f"{where}: weibull_modulus", f"{material.weibull_modulus} of bonds that never break", "none, or energy_release_rate or critical_stretch beside it")
    if not 1 <= material.weibull_modulus <= 1000:
        raise Rule(f"{where}: weibull_modulus", material.weibull_modulus, "1 to 1000; the larger, the less scatter, none without the key")


def _check_one_way(scene):
    """Raise a Rule where strengths scatter and compression raises critical stretches too: kernels know one way to find a bond's limit."""
    scatters = next((material for material in scene.material if material.weibull_modulus is not None), None)
    for number, material in enumerate(scene.material):
        if scatters is not None and material.stretch_softening > 0:
            found = f"{material.stretch_softening} beside the weibull_modulus of material '{scatters.name}'"
            raise Rule(f"{section('material', number, material)}: stretch_softening", found, "0 there")


def _check_horizons(scene):
    kinds = set()
    for number, body in enumerate(scene.body):
        if body.horizon is not None:
            where = f"{section('body', number, body)}: horizon"
            if scene.uses_mesh:
                raise Rule(where, body.horizon, f'no such key with model = "{scene.model}", which has the horizon of [particles] alone')
            spacing = scene.spacing_of(body)
            least = 2 * spacing if body.file is None else 0.0  # the sizes of particles are known when the file is read
            if not least * (1 - 1e-9) <= body.horizon <= 100 * spacing:
                raise Rule(where, body.horizon, f"2 to 100 spacings, {2 * spacing:g} to {100 * spacing:g} m")
        kinds.add((body.material, body.horizon, body.spacing))
    most = _MOST_BLOCKS // (2 if scene.damage.no_fail or scene.model == "gfem" else 1)
    if len(kinds) > most:
        raise Rule("body", f"{len(kinds)} different materials, horizons and spacings of bodies", f"at most {most}")


def _check_interfaces(scene):
    names, seen = [body.name for body in scene.body], {}
    for number, interface in enumerate(scene.interface):
        where = f"interface[{number}]: bodies"
        if scene.uses_mesh:
            raise Rule(f"interface[{number}]", "a table", f'none with model = "{scene.model}": cells that touch share their vertices')
        if len(interface.bodies) != 2 or interface.bodies[0] == interface.bodies[1]:
            raise Rule(where, interface.bodies, "the names of two different bodies")
        for name in interface.bodies:
            reference(where, name, names, "body")
        pair = frozenset(interface.bodies)
        if pair in seen:
            raise Rule(where, interface.bodies, f"each pair of bodies once (interface[{seen[pair]}] has it too)")
        seen[pair] = number


def _check_correction(scene):
    if scene.particles.surface_correction != "none" and scene.material[0].model == "lps":
        allowed = '"none" with model = "lps": its weighted volumes count the neighbours that are there, so that a change of size is exact at surfaces too'
        raise Rule("particles.surface_correction", f'"{scene.particles.surface_correction}"', allowed)
    if scene.particles.surface_correction == "volume" and scene.particles.influence == "conical":
        allowed = '"energy": volumes count cells at the horizon as much as near ones, which hold most of the energy of the conical influence'
        raise Rule("particles.surface_correction", '"volume" with influence = "conical"', allowed)


def _check_company(scene):
    """Raise a Rule for what is there for bodies of particles at one step only, beside a mesh or a fine region."""
    other = f'model = "{scene.model}"' if scene.uses_mesh else "a table [fine]" if scene.fine is not None else None
    if other is None:
        return
    if scene.particles.surface_correction != "none":
        raise Rule("particles.surface_correction", f'"{scene.particles.surface_correction}" with {other}', '"none" there')
    for number, material in enumerate(scene.material):
        where = section("material", number, material)
        if material.failure != "stretch":
            raise Rule(f"{where}: failure", f'"{material.failure}" with {other}', '"stretch" there')
        if material.stretch_softening > 0:
            raise Rule(f"{where}: stretch_softening", f"{material.stretch_softening} with {other}", "0 there")
        if material.weibull_modulus is not None:
            raise Rule(f"{where}: weibull_modulus", f"{material.weibull_modulus} with {other}", "none there")
    for number, body in enumerate(scene.body):
        if body.horizon not in (None, scene.particles.horizon):
            raise Rule(f"{section('body', number, body)}: horizon", f"{body.horizon} with {other}", f"that of [particles] there, {scene.particles.horizon:g} m")
    for number, interface in enumerate(scene.interface):
        if interface.bonds == "none":
            raise Rule(f"interface[{number}]: bonds", f'"none" with {other}', '"glued" there')
