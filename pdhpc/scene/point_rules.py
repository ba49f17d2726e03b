"""Rules of bodies whose particles stand in files, and of bodies with a spacing of their own; see rules.py."""
from pdhpc.scene.fields import Rule, show
from pdhpc.scene.sections import section

MOST_GROUPS = 64  # of one file that a scene uses: a bit each


def check_points(scene):
    """Raise a Rule for files and spacings that the scene's model or its other keys rule out."""
    for number, body in enumerate(scene.body):
        _check_body(scene, section("body", number, body), body)
    if scene.uses_mesh:
        return
    if scene.brings_points:
        _check_files(scene)
    spacings = sorted({scene.spacing_of(body) for body in scene.body if body.file is None})
    if scene.fine is not None and scene.particles.volume_correction == "linear" and any(spacing != scene.particles.spacing for spacing in spacings):
        found = f'"linear" with spacings of {", ".join(f"{each:g}" for each in spacings)} m beside particles.spacing = {scene.particles.spacing:g} m and a table [fine]'
        raise Rule("particles.volume_correction", found, '"none", which knows no spacing, or bodies of particles.spacing')
    coarsest = max((scene.spacing_of(body) for body in scene.body if body.file is None and body.horizon is None), default=0.0)
    if coarsest > scene.particles.spacing and scene.particles.horizon < 2 * coarsest * (1 - 1e-9):
        raise Rule("particles.horizon", scene.particles.horizon, f"at least 2 spacings of every body, {2 * coarsest:g} m")


def _check_body(scene, where, body):
    if body.spacing is not None and scene.uses_mesh:
        raise Rule(f"{where}: spacing", body.spacing, f'no such key with model = "{scene.model}", whose cells and particles have one size')
    if body.shape == "mesh":
        if scene.uses_mesh and body.file is not None:
            raise Rule(f"{where}: file", show(body.file), f'no such key with model = "{scene.model}": mesh.file names the file')
        if not scene.uses_mesh and body.file is None:
            raise Rule(f"{where}: file", "nothing", 'the name of a file whose cells become particles: model = "particles" needs it')


def _check_files(scene):
    if scene.particles.path == "lattice":
        raise Rule("particles.path", '"lattice" with a body from a file', '"auto" or "cloud": the particles of files lie on no lattice')
    groups = {region.group for region in scene.region if region.shape == "group"}
    for file in {body.file for body in scene.body if body.file is not None}:
        own = {getattr(body, "group", None) or getattr(body, "block", None) for body in scene.body if body.file == file}
        count = len(groups | {each for each in own if each is not None})
        if count > MOST_GROUPS:
            raise Rule("body", f"{count} groups of {file}", f"at most {MOST_GROUPS} groups and blocks of one file")
