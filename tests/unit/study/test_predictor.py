import math

import numpy as np
import pytest

from pdhpc.geometry.lattice import LatticeBody, find_common_lattice
from pdhpc.geometry.shapes import Box
from pdhpc.parallel.partition import Partition
from pdhpc.scene.read import scene_from_dict
from pdhpc.scene.schema import SceneError
from pdhpc.study.predictor import LANES, MACHINES, Cost, Machine, VirtualPartition, calibrate, check_predictable, curves, predict, predict_regions, read_machine
from pdhpc.study.scaling import PHASES

def row(ranks, seconds, particles, **more):
    """A row of ten steps whose phases share the time evenly."""
    phases = {f"{name}_{which}": seconds / len(PHASES) for name in PHASES for which in ("mean", "slowest")}
    plain = {"kind": "strong", "steps": 10, "bond_imbalance": 1.0, "bytes_per_step": 0}
    return {**plain, **phases, "ranks": ranks, "seconds": seconds, "particles": particles, **more}


FREE = Machine("no messages", "", 1, 1e30, 1e-30, 1e30, 1e-30, 1.0)


def brute(cells, ratio, boxes):
    """Return sorted [(cells owned, ghosts)] of boxes [(first, last)] of a body, by looking at every pair of cells near."""
    body = np.stack(np.meshgrid(*[np.arange(n) for n in cells], indexing="ij"), axis=-1).reshape(-1, len(cells))
    found = []
    for first, last in boxes:
        inside = ((body >= first) & (body < last)).all(axis=1)
        excess = np.maximum(0, np.maximum(np.array(first) - body, body - np.array(last) + 1))
        found.append((int(inside.sum()), int(((excess**2).sum(axis=1) <= ratio**2)[~inside].sum())))
    return sorted(found)


@pytest.mark.parametrize("cells, ratio, ranks", [((20, 15, 11), 3.0, 2), ((20, 15, 11), 3.0, 3), ((16, 16, 16), 2.5, 8), ((30, 41), 3.0, 6), ((64, 64), 3.5, 16), ((9, 8, 30), 3.0, 5)])
def test_halos_are_those_of_the_boxes(cells, ratio, ranks):
    partition = VirtualPartition(cells, ratio)
    boxes, work = [], [(tuple((0, n) for n in cells), ranks)]
    while work:  # the same cuts, each box on its own
        box, count = work.pop()
        if count == 1:
            boxes.append(([first for first, _ in box], [last for _, last in box]))
            continue
        axis, size = partition._cut(partition._look(box), count)
        first, last = box[axis]
        work += [(box[:axis] + ((first, first + size),) + box[axis + 1 :], count // 2), (box[:axis] + ((first + size, last),) + box[axis + 1 :], count - count // 2)]
    shares = partition.shares(ranks)
    assert sum(shares.values()) == ranks and sum(math.prod(share.cells) * number for share, number in shares.items()) == math.prod(cells)
    assert sorted((math.prod(share.cells), share.ghosts) for share, number in shares.items() for _ in range(number)) == brute(cells, ratio, boxes)


@pytest.mark.parametrize("cells, ranks", [((24, 18, 12), 2), ((24, 18, 12), 4), ((40, 36), 3), ((40, 36), 8)])
def test_the_real_partition_makes_the_same_shares(cells, ranks):
    """As the program cuts, from the same weights, gathered in one process."""
    from mpi4py import MPI

    from pdhpc.parallel.partition import bisect
    from pdhpc.peridynamics.lattice_subdomain import sample_lattice

    class Many:
        """One process that stands for `ranks`: its reductions are already those of all."""

        size, rank = ranks, 0

        def Allreduce(self, send, receive, op):
            assert send is MPI.IN_PLACE

    body = LatticeBody(Box((0.0,) * len(cells), tuple(float(n) for n in cells)), 1.0, 0)
    lattice, _ = find_common_lattice([body])
    points, weights = sample_lattice([body], lattice, 0, 1, 3.0 * (1 + 1e-9))
    partition = bisect(Many(), points, weights, lattice.between)
    real = sorted(np.bincount(Partition.owner(partition, points), minlength=ranks).tolist())
    virtual = sorted(math.prod(share.cells) for share, number in VirtualPartition(cells, 3.0).shares(ranks).items() for _ in range(number))
    layer = max(math.prod(cells) // n for n in cells)
    assert sum(real) == sum(virtual) and np.abs(np.subtract(real, virtual)).max() <= layer  # at most a layer apart


def test_a_large_machine_takes_seconds_and_no_particles():
    shares = VirtualPartition((1000, 1000, 1000), 3.0).shares(65536)
    assert sum(shares.values()) == 65536 and sum(math.prod(share.cells) * number for share, number in shares.items()) == 10**9


def test_without_messages_scaling_is_ideal():
    one, many = (predict((512, 512), 3.0, ranks, FREE, Cost(1e-8, 0.0)) for ranks in (1, 64))
    assert one.seconds == pytest.approx(512 * 512 * 1e-8)
    assert many.seconds == pytest.approx(one.seconds / 64) and many.rate == pytest.approx(64 * one.rate)  # 64 x 64 cells each: whole blocks of eight


def test_messages_and_memory_cost_what_the_formula_says():
    machine = Machine("m", "", 2, 4e9, 1e-6, 1e9, 1e-6, 2.0)
    share = next(iter(VirtualPartition((64, 64), 3.0).shares(2)))
    found = predict((64, 64), 3.0, 2, machine, Cost(1e-9, 2e-9))
    per_slot = max(1e-9 / 2, 2 * 96 * 2 / 4e9)  # 96 bytes a coordinate, two ranks on the node's 4 GB/s: memory-bound
    assert found.work == pytest.approx(share.blocks * LANES * per_slot)
    assert share.ghosts == 3 * 64 and found.messages == pytest.approx(192 * 2e-9 / 2 + 1e-6 + 192 * 16 / (4e9 / 8))


def test_regions_save_what_they_do_not_evaluate():
    found, speedup = predict_regions((512, 512), 3.0, 1, FREE, Cost(1e-8, 0.0), fine_share=0.0, step_ratio=10)
    assert speedup == pytest.approx(10, rel=0.01)  # nothing is fine: ten fine steps for the price of one, but for the corner overlap
    found, speedup = predict_regions((512, 512), 3.0, 1, FREE, Cost(1e-8, 0.0), fine_share=0.1, step_ratio=10, overlap=0.0)
    assert speedup == pytest.approx(10 / (1 + 0.9))  # 0.1 x 10 + 0.9


def test_calibration_gives_back_what_made_the_rows():
    slot, crowding, ghost = 2e-8, 1.25, 3e-9
    shares = {ranks: max(VirtualPartition((100, 100), 3.0).shares(ranks), key=lambda share: share.blocks) for ranks in (1, 2)}
    rows = []
    for ranks in (1, 2):
        work = shares[ranks].blocks * LANES * slot * (crowding if ranks == 2 else 1) * 10
        messages = shares[ranks].ghosts * ghost * 10
        rows.append({**row(ranks, work + messages, particles=10_000), "force_mean": work, "integrate_mean": 0.0, "contact_mean": 0.0, "exchange_mean": messages, "wait_mean": 0.0})
    cost, found = calibrate(rows, 2, 3.0)
    assert cost.slot == pytest.approx(slot) and cost.ghost == pytest.approx(ghost) and found == pytest.approx(crowding)
    with pytest.raises(SceneError, match="none on 2"):
        calibrate(rows[:1], 2, 3.0)


def test_presets_name_their_sources_and_curves_fall():
    for path in sorted(MACHINES.glob("*.toml")):
        machine = read_machine(path.stem)
        assert machine.source
        strong, weak = curves(2, 3.0, machine, Cost(3e-8, 2e-9), sizes=(1e6,), most=1024)
        efficiency = [points.seconds * points.ranks for points in strong[1e6]]
        assert efficiency[-1] > efficiency[0] and len(weak) == 2


@pytest.mark.parametrize("text, words", [("cores_per_node = 4\n", "name is missing"), ('name = "a"\nspeed = 1\n', "speed is no key"), ("name = [", "not TOML")])
def test_a_bad_machine_is_refused(tmp_path, text, words):
    (tmp_path / "machine.toml").write_text(text)
    with pytest.raises(SceneError, match=words):
        read_machine(tmp_path / "machine.toml")
    with pytest.raises(SceneError, match="allowed is archer2, epyc_genoa_ndr or a TOML file"):
        read_machine("archer3")


@pytest.mark.parametrize("change, found", [
    ({"contact": {}}, "contact or an impactor"),
    ({"time": {"end": 1e-6, "method": "newton"}, "load": [{"name": "held", "type": "displacement", "region": "all", "value": [0.0, 0.0]}]}, 'time.method = "newton"'),
    ({"body": [{"name": name, "material": "glass", "shape": "box", "lower": [x, 0.0], "upper": [x + 0.1, 0.1], **more}
               for name, x, more in (("one", 0.0, {}), ("two", 0.1, {"spacing": 0.005}))]}, "no lattice of one spacing"),
])
def test_what_the_model_of_a_step_does_not_hold_for_is_refused(change, found):
    box = {"name": "plate", "material": "glass", "shape": "box", "lower": [0.0, 0.0], "upper": [0.1, 0.1]}
    plate = {"dimension": "plane_stress", "particles": {"spacing": 0.01, "horizon": 0.03}, "body": [box], "time": {"end": 1e-6},
             "material": [{"name": "glass", "density": 2200, "youngs_modulus": 7e10, "critical_stretch": 1e-3}]}
    check_predictable(scene_from_dict(plate, "plate.toml"))
    with pytest.raises(SceneError, match=f"^plate.toml: .*{found}.*; allowed with --predict is a lattice"):
        check_predictable(scene_from_dict({**plate, **change}, "plate.toml"))
