"""Going on with a run: which checkpoints there are, what scene they are of, and a problem set to the state of one."""
import json
import math
from pathlib import Path
from typing import NamedTuple

from pdhpc.output.checkpoint import Damaged, generations, read_header, restore
from pdhpc.output.record import refusal
from pdhpc.provenance import checksum, commit, versions
from pdhpc.scene.read import changed_scene
from pdhpc.scene.schema import SceneError

_SAME = 1e-12  # relative: how closely a step found anew is that of the run


class Saved(NamedTuple):
    """A checkpoint: its path, its header, and a warning about newer ones that cannot be read, or None."""

    path: object
    header: dict
    warning: str


def find(directory):
    """Return [Saved], the newest first, of a run's checkpoints whose headers can be read. Local.

    Raises
    ------
    OutputError: there is none, or a file that the scene names is not what it was when the run read it; exit_code 2.
    """
    found, damage, run = [], [], _run_of(directory)
    for path in generations(directory):
        try:
            header = read_header(path)
            if run is not None and header.get("run") != run:
                raise Damaged(f"{path}: is of another run than {directory}/run.json")
            found.append(Saved(path, header, "; ".join(damage) or None))
        except Damaged as error:
            damage.append(str(error))
    if not found:
        raise refusal(f"{directory}: {'; '.join(damage) or 'no checkpoint found'}; allowed is the folder of a run that saved its state")
    _check_files(found[0])
    return found


def _run_of(directory):
    """Return what tells a run from all others, as its run.json has it; None where that cannot be read."""
    try:
        return json.loads((Path(directory) / "run.json").read_text(encoding="utf-8"))["run"]
    except (OSError, ValueError, KeyError, TypeError):
        return None


def remarks(saved):
    """Return sentences on what is no longer as it was: the scene's file, which is not read again, and the code. Local."""
    before = {**saved.header["versions"], "commit": saved.header.get("commit")}
    other = [f"{name} {before.get(name)}, now {here}" for name, here in {**versions(), "commit": commit()}.items() if before.get(name) != here]
    found = [f"{saved.path} was written by other code ({'; '.join(other)}): digits may differ"] if other else []
    path, digest = Path(saved.header["scene_file"]), saved.header.get("scene_sha256")
    if digest is None or not path.is_file() or checksum(path) == digest:
        return found
    return [*found, f"{path} was changed since the run began, which goes on with the scene as it was; allowed to change are time.end and keys of output and checkpoint, by --set"]


def _check_files(saved):
    """Raise an OutputError unless the files that a run read are there as they were."""
    for name, digest in saved.header.get("files", {}).items():
        path = Path(saved.header["scene_file"]).parent / name
        try:
            wrong = None if checksum(path) == digest else "is not what it was when the run read it"
        except OSError as caught:
            wrong = f"cannot be read ({caught.strerror})"
        if wrong:
            raise refusal(f"{path}: {wrong}; allowed is the file with SHA-256 {digest}, as {saved.path} needs it")


def scene_of(saved, directory, overrides):
    """Return the Scene of a run, with what may change changed. Local.

    Raises
    ------
    SceneError: an override of another key than time.end and those of output and checkpoint.
    """
    for override in overrides:
        word = override.partition("=")[0].strip()
        if word != "time.end" and word.split(".")[0] not in ("output", "checkpoint"):
            raise SceneError(f"pdhpc restart {directory}: --set {override}; allowed is time.end, and keys of output and checkpoint: the rest of a scene stays as the run began")
    before, name = saved.header["scene"], saved.header["scene_file"]
    scene, end = changed_scene(before, name, overrides), before["time"]["end"]
    if scene.time.end == end:
        return scene
    if scene.stands_still or scene.model == "fem" and scene.fem.integration == "static":
        raise SceneError(f"pdhpc restart {directory}: time.end = {scene.time.end:g}; allowed is {end:g}: the load path of a body that stands still is fixed")
    return changed_scene({**before, "time": {**before["time"], "dt": saved.header["dt"]}}, name, overrides)  # "auto" is of whole steps to the former end


def go_on(comm, saved, problem, entries):
    """Set a run's entries to the newest of the checkpoints that can be read; return it and warnings. Collective.

    Raises
    ------
    OutputError: on every rank.
    """
    warnings, damage = [], None
    for each in saved:
        _check_step(each, problem)
        try:
            restore(comm, each.path, each.header, entries)
        except Damaged as error:
            damage = str(error)
            continue
        warnings += [words for words in (each.warning, damage) if words]
        return each, [f"{'; '.join(warnings)}: the run goes on from step {each.header['step']}"] if warnings else []
    raise refusal(f"{damage}; allowed is a checkpoint as the run left it")


def _check_step(saved, problem):
    """Raise an OutputError unless a problem has the step of a checkpoint, and an end behind it."""
    dt, step = saved.header["dt"], saved.header["step"]
    if not math.isclose(dt, problem.dt, rel_tol=_SAME):
        raise refusal(f"{saved.path}: was written with a step of {dt:.12g} s, where this scene has {problem.dt:.12g} s; allowed is a checkpoint of this scene and version")
    if step > problem.n_steps:
        raise refusal(f"{saved.path}: is of step {step}, t = {step * dt:.6g} s; allowed is a time.end of at least that")
