"""Predict how a lattice body scales on machines nobody has here: the program's partition without its particles, and a model of a step.

    t = max over ranks of [ 8 blocks max(c, bytes / share of the memory bandwidth) + ghosts g + neighbours latency + bytes sent / share of the network ]

c, seconds a slot and step, and g, seconds a ghost and step (packing, unpacking, waiting), are calibrated by runs on this machine. A rank sweeps whole blocks
of eight slots. IGNORED says what is left out.
"""
import itertools
import math
import statistics
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pdhpc.peridynamics.lattice_subdomain import make_stencil
from pdhpc.scene.body import path_of
from pdhpc.scene.read import tomllib
from pdhpc.scene.schema import SceneError

LANES = 8
IGNORED = (
    "contention in the network and its topology; noise of the operating system; where ranks lie in a node; the overlap of messages with work (pessimistic);"
    " caches that hold a small share whole (pessimistic); bonds that break; energies and output"
)
"""What a prediction leaves out."""
MACHINES = Path(__file__).parent / "machines"
_GHOST_BYTES = 8  # a coordinate
_SLOT_BYTES = 12 * 8  # a slot, a coordinate and a step: 3 reads and 2 writes of two passes of integration, 1 read and 1 write (and its ownership) of forces


class Machine(NamedTuple):
    """A machine: see machines/*.toml for units; core_speed is relative to the core that was calibrated;
    crowding: how much slower a core is when all of its node work.
    """

    name: str
    source: str
    cores_per_node: int
    memory_bandwidth: float
    network_latency: float
    network_bandwidth: float
    node_latency: float
    core_speed: float
    crowding: float = 1.0


class Cost(NamedTuple):
    """What was calibrated on one core: slot and ghost, seconds each and step."""

    slot: float
    ghost: float


class Share(NamedTuple):
    """What one rank owns: cells along each axis, blocks of eight slots, ghosts, and how many ranks those come from."""

    cells: tuple
    blocks: int
    ghosts: int
    neighbours: int


class Prediction(NamedTuple):
    """A step on `ranks` ranks: seconds, particle-steps a second, and the parts of the slowest rank, seconds."""

    ranks: int
    seconds: float
    rate: float
    work: float
    messages: float


def check_predictable(scene):
    """Raise a SceneError unless a step of the scene is what the model describes: forces of bonds on one lattice, of one time step."""
    found = None
    if path_of(scene) != "lattice":
        found = "bodies that are no lattice of one spacing"
    elif scene.contact is not None or scene.impactor:
        found = "contact or an impactor"
    elif scene.method != "single":
        found = f'time.method = "{scene.method}"'
    if found is not None:
        raise SceneError(f"{scene.source}: {found}; allowed with --predict is a lattice of one spacing, without contact, by one time step")


def read_machine(name):
    """Return the Machine of a preset's name or of a TOML file; a SceneError says what is wrong."""
    presets = {path.stem: path for path in sorted(MACHINES.glob("*.toml"))}
    path = presets.get(str(name), Path(name))
    if not path.is_file():
        raise SceneError(f"machine {name}; allowed is {', '.join(presets)} or a TOML file with {', '.join(Machine._fields)}")
    try:
        data = tomllib.loads(path.read_text())
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{path}: not TOML ({error})") from None
    for word in data:
        if word not in Machine._fields:
            raise SceneError(f"{path}: {word} is no key of a machine; allowed is {', '.join(Machine._fields)}")
    for word in Machine._fields:
        if word not in data and word not in Machine._field_defaults:
            raise SceneError(f"{path}: {word} is missing; allowed is {', '.join(Machine._fields)}")
        if word in data and word not in ("name", "source") and not (isinstance(data[word], (int, float)) and data[word] > 0):
            raise SceneError(f"{path}: {word} = {data[word]}; allowed is a number above 0")
    return Machine(**data)


class VirtualPartition:
    """The recursive bisection of a box of cells over any number of ranks, by numbers of bonds, without particles.

    As parallel/partition.py: a box is cut across its longest side, between the layers where its bonds are shared out best. Boxes that look alike (same size,
    same distances to the body's sides up to the reach of the stencil) are cut once: 65,536 ranks of 1e9 particles take seconds.
    """

    def __init__(self, cells, ratio):
        """cells : (dim,) int, of the whole box; ratio : family radius over spacing."""
        self.cells, self.ratio, self.reach = tuple(int(n) for n in cells), ratio, int(ratio)
        self.stencil = make_stencil(len(cells), ratio)
        self._cut = lru_cache(maxsize=None)(self._cut)

    def shares(self, ranks):
        """Return {Share: how many ranks have one like it}."""
        found, work = {}, {}
        work[tuple((0, n) for n in self.cells), ranks] = 1
        while work:
            (box, count), copies = work.popitem()
            if count == 1:
                share = self._share(box)
                found[share] = found.get(share, 0) + copies
                continue
            axis, size = self._cut(self._look(box), count)
            first, last = box[axis]
            for part, number in (((first, first + size), count // 2), ((first + size, last), count - count // 2)):
                child = self._like(box[:axis] + (part,) + box[axis + 1 :])
                work[child, number] = work.get((child, number), 0) + copies
        return found

    def _look(self, box):
        """Return (size, gap below, gap above) of a box along each axis, gaps counted up to the reach."""
        return tuple((last - first, min(first, self.reach), min(n - last, self.reach)) for (first, last), n in zip(box, self.cells))

    def _like(self, box):
        """Return the representative of the boxes that look like this one: moved as near to the body's low corner as its looks allow."""
        like = []
        for (first, last), n in zip(box, self.cells):
            size, above = last - first, min(n - last, self.reach)
            start = min(first, self.reach) if above == self.reach else n - above - size
            like.append((start, start + size))
        return tuple(like)

    def _cut(self, look, count):
        """Return (axis, layers of the first part) for `count` ranks."""
        sizes = [size for size, _, _ in look]
        axis = int(np.argmax(sizes))
        layers = np.zeros(sizes[axis])
        place = np.arange(sizes[axis])
        for offset in self.stencil:
            others = 1
            for other, (size, below, above) in enumerate(look):
                if other != axis:
                    others *= self._inside(size, below, above, int(offset[other]))
            target = place + offset[axis]
            layers += others * ((target >= -look[axis][1]) & (target < sizes[axis] + look[axis][2]))
        upto = np.concatenate(([0.0], np.cumsum(layers)))
        size = int(np.argmin(np.abs(upto - upto[-1] * (count // 2) / count)))
        return axis, min(max(size, 1), sizes[axis] - 1) if sizes[axis] > 1 else 0

    @staticmethod
    def _inside(size, below, above, step):
        """Return how many of `size` cells have the cell `step` further inside of the body."""
        return max(0, size - max(0, -step - below) - max(0, step - above))

    def _share(self, box):
        """Return the Share of a box."""
        look = self._look(box)
        sizes = [size for size, _, _ in look]
        if min(sizes) < 1:
            return Share(tuple(sizes), 0, 0, 0)
        fast = max(range(len(sizes)), key=lambda axis: (sizes[axis], axis))
        blocks = math.prod(size for axis, size in enumerate(sizes) if axis != fast) * -(-sizes[fast] // LANES)
        ghosts = neighbours = 0
        for side in itertools.product((-1, 0, 1), repeat=len(sizes)):
            if any(side):
                number = self._ghosts_beyond(look, side)
                ghosts, neighbours = ghosts + number, neighbours + (number > 0)
        return Share(tuple(sizes), blocks, ghosts, neighbours)

    def _ghosts_beyond(self, look, side):
        """Return the number of ghosts beyond a face, edge or corner of a box: cells whose nearest owned cell lies within the family radius."""
        beyond = [range(1, (below if way < 0 else above) + 1) for (_, below, above), way in zip(look, side) if way]
        along = math.prod(size for (size, _, _), way in zip(look, side) if not way)
        return along * sum(sum(step * step for step in steps) <= self.ratio**2 for steps in itertools.product(*beyond))


def predict(cells, ratio, ranks, machine, cost):
    """Return the Prediction of a box of `cells` on `ranks` ranks of a Machine."""
    dim, nodes = len(cells), max(1, math.ceil(ranks / machine.cores_per_node))
    per_node = min(ranks, machine.cores_per_node)
    slowest = (0.0, 0.0, 0.0)
    for share in VirtualPartition(cells, ratio).shares(ranks):
        crowding = 1.0 + (machine.crowding - 1.0) * (per_node - 1) / max(1, machine.cores_per_node - 1)
        seconds = max(cost.slot * crowding / machine.core_speed, dim * _SLOT_BYTES * per_node / machine.memory_bandwidth)
        work = share.blocks * LANES * seconds
        latency = machine.network_latency if nodes > 1 else machine.node_latency
        bandwidth = machine.network_bandwidth / per_node if nodes > 1 else machine.memory_bandwidth / (4 * per_node)
        messages = share.ghosts * cost.ghost / machine.core_speed + share.neighbours * latency + share.ghosts * dim * _GHOST_BYTES / bandwidth
        slowest = max(slowest, (work + messages, work, messages))
    return Prediction(ranks, slowest[0], math.prod(cells) / slowest[0], slowest[1], slowest[2])


def predict_regions(cells, ratio, ranks, machine, cost, fine_share, step_ratio, overlap=1.0, interface=0.0):
    """Return (multi-time-step Prediction of a macro step, speed-up over the fine step everywhere).

    The fine region holds `fine_share` of the particles and takes step_ratio sub-steps while the rest takes one; ranks are shared out by work, so that

        work = (step_ratio fine + coarse + (step_ratio + 1) overlap) / ranks,

    the overlap being a layer of `overlap` family radii around a cube (square) of the fine particles, which both regions evaluate; messages are those of
    `predict`, once each sub-step; interface: work of the multipliers as a share of the macro step.
    """
    dim, particles = len(cells), math.prod(cells)
    side = (fine_share * particles) ** (1 / dim)
    shared = (side + overlap * ratio) ** dim - side**dim
    evaluations = step_ratio * fine_share * particles + (1 - fine_share) * particles + (step_ratio + 1) * shared
    once = predict(cells, ratio, ranks, machine, cost)
    work = once.work * evaluations / particles
    seconds = (work + once.messages * step_ratio) / (1 - interface)
    return Prediction(ranks, seconds, evaluations / seconds, work, once.messages * step_ratio), step_ratio * once.seconds / seconds


def curves(dim, ratio, machine, cost, sizes=(1e6, 1e7, 1e8, 1e9), most=65536):
    """Return (strong {particles: [Prediction]}, weak {particles a rank: [Prediction]}) over 1, 2, 4 ... `most` ranks; bodies are cubes (squares)."""
    numbers = [2**power for power in range(int(math.log2(most)) + 1)]
    strong = {}
    for size in sizes:
        side = round(size ** (1 / dim))
        strong[size] = [predict((side,) * dim, ratio, count, machine, cost) for count in numbers if side**dim / count >= 1000]
    weak = {}
    for per_rank in (1e4, 1e5):
        weak[per_rank] = [predict((round((per_rank * count) ** (1 / dim)),) * dim, ratio, count, machine, cost) for count in numbers]
    return strong, weak


def calibrate(rows, dim, ratio):
    """Return (Cost, crowding) out of rows of a scaling study of one body on 1 and on 2 ranks, medians of its repeats.

    c = (force + integrate + contact)/slots on one rank; crowding = the same on two ranks over it; g = (exchange + wait)/ghosts on two ranks.
    """
    work, messages, shares = {}, {}, {}
    for ranks in (1, 2):
        here = [row for row in rows if row["ranks"] == ranks]
        if not here:
            raise SceneError(f"a prediction is calibrated by runs on 1 and on 2 ranks; there is none on {ranks}")
        cells = (round(here[0]["particles"] ** (1 / dim)),) * dim
        shares[ranks] = max(VirtualPartition(cells, ratio).shares(ranks), key=lambda share: share.blocks)
        work[ranks] = statistics.median(sum(row[f"{name}_mean"] for name in ("force", "integrate", "contact")) / row["steps"] for row in here) / (shares[ranks].blocks * LANES)
        messages[ranks] = statistics.median((row["exchange_mean"] + row["wait_mean"]) / row["steps"] for row in here)
    return Cost(work[1], messages[2] / max(1, shares[2].ghosts)), work[2] / work[1]
