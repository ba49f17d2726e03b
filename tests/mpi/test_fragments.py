"""Fragments across ranks: the same on any number of them."""
from types import SimpleNamespace

import numpy as np
import pytest

from pdhpc.observers.fragments import Fragments
from pdhpc.scene.build import build
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import plate

SETTINGS = SimpleNamespace(damage=0.35, particles=5)


def spiral(turns=2, points=80):
    """Return a crack along a spiral: what it leaves winds through all ranks several times."""
    angle = np.linspace(0.0, 2 * np.pi * turns, points)
    xy = np.stack([angle * np.cos(angle), angle * np.sin(angle)], axis=1) * 1.4
    return f'[[crack]]\ntype = "polyline"\npoints = {xy.tolist()}\n'


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path", ("lattice", "cloud"))
@pytest.mark.parametrize("extra", [spiral(), "".join(f'[[crack]]\ntype = "polyline"\npoints = [[-30.0, {y}.0], [30.0, {y}.0]]\n' for y in (-9, -2, 8))], ids=["spiral", "strips"])
def test_the_same_on_one_rank(comm, path, extra):
    from mpi4py import MPI

    scene = parse_scene(plate((44, 36), 2.2, extra=extra), "t", [f"particles.path={path}"])
    found = []
    for each in (comm, MPI.COMM_SELF):
        problem = build(scene, each)
        particles, x = problem.subdomain.particles, problem.subdomain.places()
        hurt = (np.abs(x[:, 0] - 10.0) < 2.3) & (x[:, 1] > 0.0)
        alive = problem.subdomain.bonds.arrays.alive
        if path == "lattice":
            alive[:, particles.slots[hurt]] = 0
        else:
            rows = problem.subdomain.bonds.arrays.row_start
            for row in np.flatnonzero(hurt):
                alive[rows[row] >> 3 : rows[row + 1] >> 3] = 0
        fragments = Fragments(each, SETTINGS, problem.parts[0], problem.body.law.density)
        labels = each.allgather((particles.id[: particles.n_owned], fragments.labels()))
        order = np.argsort(np.concatenate([ids for ids, _ in labels]))
        found.append((np.concatenate([label for _, label in labels])[order], fragments.find(SimpleNamespace(step=0))))
    assert np.array_equal(found[0][0], found[1][0]) and found[0][1] == found[1][1], "every digit of the shares too"
    assert found[0][1]["count"] >= 1 and found[0][1]["dust"] > 0.0


@pytest.mark.mpi(min_size=2)
def test_ids_in_no_order_in_space(comm, tmp_path_factory):
    """The rows of a table, shuffled: on no rank has a particle near a border the lowest id of its rank, which is all that a set goes by."""
    path = None
    if comm.rank == 0:
        path = tmp_path_factory.mktemp("rows") / "points.txt"
        places = np.random.default_rng(2).permutation([(i + 0.5, j + 0.5) for i in range(60) for j in range(8)])
        path.write_text("".join(f"{x} {y} 1.0 1\n" for x, y in places))
    path = comm.bcast(path)
    text = plate((60, 8)).replace("lower = [-30.0, -4.0]\n", "").replace("upper = [30.0, 4.0]\n", "").replace('shape = "box"', f'shape = "table"\nfile = "{path}"')
    fragments = Fragments(comm, SETTINGS, build(parse_scene(text, "t"), comm).parts[0], np.ones(1))
    assert np.all(fragments.labels() == 0) and fragments.find(SimpleNamespace(step=0))["count"] == 1
