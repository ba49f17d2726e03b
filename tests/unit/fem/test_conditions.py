import numpy as np

from pdhpc.conditions.loads import BodyForce, PrescribedMotion
from pdhpc.conditions.time_functions import Constant, Ramp
from pdhpc.fem.conditions import NodalConditions
from pdhpc.fem.nodes import Nodes
from pdhpc.study.verify.fem_problems import box_mesh


def test_loads_and_motions_act_and_their_work_is_kept(comm):
    nodes = Nodes(box_mesh(comm, (2, 2)), False)
    nodes.set_mass(np.full(9, 2.0))
    load, motion = BodyForce([0, 4], [[1.0, 0.0], [0.0, 3.0]], Constant()), PrescribedMotion([8], [1], [0.5], Ramp(0.0, 1.0), "displacement")
    conditions = NodalConditions(nodes, [load], [motion])
    assert np.argwhere(conditions.constrained()).tolist() == [[8, 1]]
    conditions.settle(0.0)
    conditions.begin()
    assert nodes.velocity[8, 1] == 0.5 and conditions.external_work().tolist() == [0.0, 0.0, 0.0]
    conditions.add_loads(0.0)
    nodes.force[8, 1] = -4.0
    nodes.velocity[0, 0] = 10.0
    conditions.steer(0.1, 0.1)
    assert nodes.velocity[8, 1] == 0.5  # 0.05 m in 0.1 s
    conditions.work_of_old_forces(0.1)
    conditions.work_of_new_forces(0.1, 0.1)
    assert np.allclose(conditions.external_work(), [1.0 * 10.0 * 0.1, 0.0, 4.0 * 0.5 * 0.1])  # the kinetic energy of the support is as at the start
    nodes.velocity[8, 1] = 1.5
    assert np.allclose(conditions.external_work()[2], 0.2 + 0.5 * 2.0 * (1.5**2 - 0.5**2))
    saved = {key: np.copy(get()) for key, (get, *_) in conditions.state().items()}
    assert set(saved) == {"work/0", "work/1", "initial_kinetic/0"}
    conditions.state()["work/0"][1](np.array([7.0, 8.0]))
    assert load.work.tolist() == [7.0, 8.0]
