"""On several ranks: tests/mpi/test_simulation.py."""
import hashlib
import platform

from pdhpc.provenance import checksum, checksums, describe_shares, hosts_of, introduction, versions
from pdhpc.scene.read import parse_scene
from pdhpc.simulation import Simulation
from pdhpc.study.verify.bodies import cracked, write_table
from pdhpc.study.verify.case import plate


def test_versions_of_all_that_numbers_depend_on():
    found = versions()
    assert {"pdhpc", "python", "numpy", "numba", "mpi4py", "mpi", "petsc4py", "h5py", "hdf5"} == set(found) and all(found.values())


def test_one_rank(comm):
    assert hosts_of(comm) == {platform.node(): 1}
    assert describe_shares(comm, {"particles": 1200, "ghosts": 0}) == ["it has 1,200 particles, 0 ghosts"]


def test_files_are_known_by_their_content(tmp_path):
    write_table(tmp_path / "points.txt", cracked((8, 6)))
    scene = parse_scene(cracked((8, 6), body='shape = "table"\nfile = "points.txt"'), str(tmp_path / "scene.toml"))
    digest = hashlib.sha256((tmp_path / "points.txt").read_bytes()).hexdigest()
    assert checksums(scene) == ({"points.txt": digest}, None) and checksum(tmp_path / "points.txt") == digest
    (tmp_path / "points.txt").unlink()
    (tmp_path / "scene.toml").write_bytes(b"abc")
    assert checksums(scene) == ({}, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad")  # FIPS 180-2, appendix B.1


def test_the_first_lines_of_a_log(comm):
    lines = introduction(Simulation(parse_scene(plate((6, 4)), "p.toml", ["output.frames=1"]), comm))
    for words in ("pdhpc ", "command: ", "scene: p.toml", f"1 rank: 1 on {platform.node()}", "it has 24 particles, 0 ghosts", "set up in", " steps of "):
        assert any(line.startswith(words) or words in line for line in lines), words
