"""Bad input in real launches, on one rank and on two: exit code 2, one line on stderr, no traceback, nothing written or overwritten."""
import hashlib
import shutil

import pytest

from pdhpc.output.checkpoint import generations
from pdhpc.study.verify.bodies import cracked
from tests.faults.broken import mesh_bytes
from tests.faults.injected import begin, end, one_sentence
from tests.faults.soak import RUN, SCENE

WORDS = {
    "unknown key": (["run", "key.toml"], '(did you mean "horizon"?)'),
    "wrong type": (["run", "type.toml"], "spacing"),
    "missing file": (["run", "nowhere.toml"], "nowhere.toml"),
    "broken TOML": (["run", "broken.toml"], "broken.toml"),
    "broken mesh": (["run", "mesh.toml"], "half.msh"),
    "broken table": (["run", "table.toml"], "torn.txt"),
    "no such key set": (["run", "scene.toml", "--set", "particles.spacin=1"], "spacing"),
    "a folder that holds a run": (["run", "scene.toml", "-o", "held"], "allowed is an empty or new folder, or --overwrite"),
    "damaged checkpoints": (["restart", "damaged"], "damaged"),
    "another key on restart": (["restart", "held", "--set", "particles.horizon=2e-3"], "allowed is time.end, and keys of output and checkpoint"),
    "restart of no run": (["restart", "empty"], "no checkpoint found"),
    "1e12 particles": (["run", "scene.toml", "--set", "particles.spacing=5e-8", "--set", "particles.horizon=1.5e-7"], "which makes about 9.6e+11 particles"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with what these launches are given: broken scenes and files, a run, and one whose checkpoints are damaged."""
    folder = tmp_path_factory.mktemp("launches")
    write = {
        "scene.toml": SCENE,
        "key.toml": SCENE.replace("horizon = ", "horizn = "),
        "type.toml": SCENE.replace("spacing = 0.5e-3", 'spacing = "small"'),
        "broken.toml": SCENE.replace("[particles]", "[particles"),
        "mesh.toml": cracked((8, 6), body='shape = "mesh"\nfile = "half.msh"'),
        "table.toml": cracked((8, 6), body='shape = "table"\nfile = "torn.txt"'),
        "torn.txt": "x y volume block\n0.5 0.5 1.0 1\n1.5 0.5\n",
    }
    for name, text in write.items():
        (folder / name).write_text(text)
    (folder / "half.msh").write_bytes(mesh_bytes("msh")[:1000])
    (folder / "empty").mkdir()
    assert end(begin(1, "", "run", folder / "scene.toml", "-o", folder / "held", *RUN, "--set", "time.end=3e-6", "--set", "output.frames=1")) == (0, [])
    shutil.copytree(folder / "held", folder / "damaged")
    for path in generations(folder / "damaged"):
        path.write_bytes(path.read_bytes()[:1000])
    return folder


def digests(folder):
    """Return {name: digest, None of folders} of all that is below a folder."""
    return {str(path.relative_to(folder)): path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.rglob("*")}


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("what", WORDS)
def test_it_is_refused_in_one_sentence(folder, monkeypatch, what, ranks):
    monkeypatch.chdir(folder)
    words, part = WORDS[what]
    output = [] if "restart" in words or "-o" in words else ["-o", "out"]
    before = digests(folder)
    code, said = end(begin(ranks, "", *words, *output))
    assert code == 2 and part in one_sentence(said), (code, said)
    assert digests(folder) == before
