"""Scaling studies: one launch for each number of ranks, one row for each launch, a report of them all."""
import csv
import hashlib
import io
import json
import statistics
import subprocess
import sys
from pathlib import Path
from typing import Annotated, List, Literal

from pydantic import ValidationError

from pdhpc.output.record import OutputError, write_json, write_text
from pdhpc.scene.fields import Flag, Listed, Table, Text, key, show
from pdhpc.scene.read import read_text, tomllib
from pdhpc.scene.schema import SceneError
from pdhpc.scene.sentences import listed, nearest
from pdhpc.study.launch import launch_command

PHASES = ("force", "exchange", "wait", "integrate", "contact")
COLUMNS = (
    "study", "kind", "commit", "host", "ranks", "repeat", "path", "particles", "bonds", "steps", "seconds", *(f"{name}_mean" for name in PHASES),
    *(f"{name}_slowest" for name in PHASES), "output", "setup", "bond_imbalance", "force_imbalance", "ghosts", "bytes_per_step",
    "particle_steps_per_second_and_core",
)
"""Columns of scaling.csv: seconds of the timed steps on the slowest rank, and of each phase on the mean and on the slowest rank; output: of one frame."""


class Study(Table):
    """A scaling study; see COLUMNS for what it measures."""

    title: Text = key("title of the study", default="")
    scene: Text = key("scene file, relative to the study")
    kind: Literal["strong", "weak"] = key("strong: the same body on every number of ranks; weak: a body that grows with it")
    ranks: List[int] = key("numbers of ranks, one launch each")
    grow: Annotated[List[Literal["x", "y", "z"]], Listed] = key("weak: axes along which the boxes of the scene grow, as evenly as the number allows", default=[])
    warm_up: int = key("steps before the clock starts", default=5)
    steps: int = key("steps on the clock", default=50)
    repeats: int = key("launches of each number of ranks, in turns", default=3)
    set: List[Text] = key('changes to the scene, "section.key=value"', default=[])
    launcher: Literal["auto", "mpirun", "srun"] = key("auto: srun inside a Slurm allocation, else mpirun", default="auto")
    output: Flag = key("write one frame after the timed steps and time it", default=True)


def read_study(path, overrides=()):
    """Return the Study of a TOML file; a SceneError says in one sentence what is wrong. overrides: "key=value" texts."""
    name, text = str(path), read_text(path)
    for override in overrides:
        if "=" not in override:
            raise SceneError(f"{name}: --set {override}; allowed is key=value, such as ranks=[1,2,4]")
    try:
        data = tomllib.loads(text)
        for override in overrides:
            word, value = override.split("=", 1)
            data.update(tomllib.loads(f"{word.strip()} = {value}"))
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{name}: not TOML ({error}); allowed is a TOML study file") from None
    try:
        study = Study.model_validate(data)
    except ValidationError as error:
        raise SceneError(f"{name}: {_sentence(data, error.errors(include_url=False)[0])}") from None
    _check(study, name)
    return study


def _sentence(data, error):
    word = str(error["loc"][0])
    field = Study.model_fields.get(word)
    if field is None:
        return f"{word} is no key of a study; allowed is {listed(Study.model_fields)}{nearest(word, Study.model_fields)}"
    if error["type"] == "missing":
        return f"{word} is missing; allowed is {field.description}"
    return f"{word} = {show(data.get(word))}; allowed is {field.description} ({error['msg'].lower()})"


def _check(study, name):
    def refuse(word, allowed):
        raise SceneError(f"{name}: {word} = {show(getattr(study, word))}; allowed is {allowed}")

    if not study.ranks or any(isinstance(count, bool) or count < 1 for count in study.ranks) or len(set(study.ranks)) < len(study.ranks):
        refuse("ranks", "one or more different whole numbers of at least 1")
    for word, least in (("warm_up", 0), ("steps", 1), ("repeats", 1)):
        if getattr(study, word) < least:
            refuse(word, f"a whole number of at least {least}")
    if (study.kind == "weak") != bool(study.grow):
        refuse("grow", 'one or more axes for kind = "weak", none for "strong"')
    if len(set(study.grow)) < len(study.grow):
        refuse("grow", "different axes")


def digest(study):
    """Return a short digest of what a study measures: all but its numbers of ranks, repeats and launcher."""
    text = study.model_dump_json(exclude={"ranks", "repeats", "launcher", "title"})
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def scene_of_point(study, folder, ranks):
    """Return the Scene of a study on a number of ranks."""
    from pdhpc.scene.read import read_scene, scene_from_dict

    path = Path(folder) / study.scene
    scene = read_scene(path, study.set)
    if scene.model != "particles":
        raise SceneError(f'{path}: model = "{scene.model}"; allowed is "particles": scaling studies count particles and bonds')
    if study.kind == "strong":
        return scene
    data = scene.model_dump(mode="json", exclude_none=True)
    factors = spread(ranks, len(study.grow))
    for number, body in enumerate(data["body"]):
        if body["shape"] != "box":
            raise SceneError(f"{path}: body[{number}]: shape = \"{body['shape']}\"; allowed is box in a weak study, whose bodies grow")
        for axis, factor in zip(study.grow, factors):
            a = "xyz".index(axis)
            if a >= scene.dim:
                raise SceneError(f"{path}: grow along {axis}; allowed is an axis of a {scene.dim}D body")
            body["upper"][a] = body["lower"][a] + factor * (body["upper"][a] - body["lower"][a])
    return scene_from_dict(data, str(path))


def spread(number, axes):
    """Return `axes` whole factors of a number, as equal as its prime factors allow, largest first."""
    factors, rest, prime = [1] * axes, number, 2
    primes = []
    while rest > 1:
        while rest % prime == 0:
            primes.append(prime)
            rest //= prime
        prime += 1
    for each in reversed(primes):
        factors[factors.index(min(factors))] *= each
    return sorted(factors, reverse=True)


def run_study(path, directory, overrides=(), point=None, again=False, say=print):
    """Run the launches of a study that are not done yet, all or those of the `point`-th number of ranks; return (Study, rows).

    Raises
    ------
    SceneError: bad study, scene or point. OutputError: rows of another commit or study in `directory`, or a launch that failed.
    """
    study, directory = read_study(path, overrides), Path(directory)
    chosen = list(enumerate(study.ranks))
    if point is not None:
        if not 0 <= point < len(chosen):
            raise SceneError(f"{path}: --point {point}; allowed is 0 to {len(chosen) - 1}, one for each number of ranks")
        chosen = [chosen[point]]
    for _, ranks in chosen:
        scene_of_point(study, Path(path).parent, ranks)
    commit = commit_of_program()
    try:
        (directory / "points").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{directory}: cannot be used as output folder ({error.strerror})") from error
    _refuse_mixed(directory, commit, digest(study))
    for repeat in range(study.repeats):  # in turns, so that a busy spell of the machine does not hit one number of ranks alone
        for _, ranks in chosen:
            file = directory / "points" / f"ranks_{ranks:06d}_repeat_{repeat:03d}.json"
            if file.exists() and not again:
                continue
            row = {"study": digest(study), "kind": study.kind, "commit": commit, "repeat": repeat, **_launch(study, Path(path), ranks)}
            write_json(file, row)
            say(f"{ranks} ranks, repeat {repeat}: {row['seconds'] / row['steps'] * 1e3:.3g} ms a step")
    rows = read_rows(directory)
    write_text(directory / "scaling.csv", table_text(rows))
    return study, rows


def _launch(study, path, ranks):
    """Run one launch and return what it measured."""
    words = ["-m", "pdhpc.study.scaling_point", str(path.resolve()), str(ranks), study.model_dump_json()]
    command, environment = launch_command(ranks, [sys.executable, "-m", "mpi4py", *words], study.launcher)
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode or not lines:
        last = next((line for line in reversed(done.stderr.strip().splitlines()) if line.strip()), "no output")
        raise OutputError(f"{path}: the launch on {ranks} ranks failed ({last.strip()[:300]})")
    return json.loads(lines[-1])


def commit_of_program():
    """Return the git commit of the program with "+" when it is modified, or its version."""
    from pdhpc.provenance import commit, versions

    return commit() or versions()["pdhpc"]


def _refuse_mixed(directory, commit, study):
    for row in read_rows(directory):
        for word, here in (("commit", commit), ("study", study)):
            if row[word] != here:
                error = OutputError(f"{directory}: holds rows of {word} {row[word]}; allowed is {word} {here} alone, or another folder")
                error.exit_code = 2
                raise error


def read_rows(directory):
    """Return the rows in a folder, by number of ranks and repeat; what a killed launch left is passed over."""
    rows = []
    for file in sorted((Path(directory) / "points").glob("ranks_*_repeat_*.json")):
        try:
            rows.append(json.loads(file.read_text()))
        except (OSError, ValueError):
            continue
    return rows


def table_text(rows):
    """Return the rows as the text of scaling.csv."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def efficiencies(rows):
    """Return [(ranks, seconds a step, efficiency, {phase: share of the mean rank's step})], medians of repeats.

    Strong: E = t_1 r_1 / (t r), weak: E = (t_1 / n_1) r_1 / ((t / n) r) with n particles, so that bodies which do not grow exactly with the number of ranks
    are compared fairly; index 1: the smallest number of ranks.
    """
    table, first = [], None
    for ranks in sorted({row["ranks"] for row in rows}):
        here = [row for row in rows if row["ranks"] == ranks]
        step = statistics.median(row["seconds"] / row["steps"] for row in here)
        work = here[0]["particles"] if here[0]["kind"] == "weak" else 1
        cost = step * ranks / work
        first = first or cost
        shares = {name: statistics.median(row[f"{name}_mean"] / row["seconds"] for row in here) for name in PHASES}
        table.append((ranks, step, first / cost, shares))
    return table
