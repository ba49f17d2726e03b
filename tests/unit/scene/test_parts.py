import numpy as np

from pdhpc.scene.body import make_body
from pdhpc.scene.parts import make_part, partition_of, sample_of
from pdhpc.scene.read import parse_scene
from pdhpc.study.verify.case import plate


def test_a_part_of_the_whole_body(comm):
    for path in ("lattice", "cloud"):
        scene = parse_scene(plate((6, 4)), "scene", [f"particles.path={path}"])
        body = make_body(scene)
        points, weights = sample_of(scene, body, comm)
        part = make_part(scene, body, comm, partition_of(scene, body, comm, (points, weights)))
        assert weights.sum() == part.subdomain.bonds.n_directed and part.counted().all() and part.subdomain.particles.n_owned == 24
        part.settle_bonds(body.law)
        part.find_critical_step(body.law)
        assert np.isfinite(part.critical_dt) and part.critical_dt_of(comm) == part.critical_dt
