"""Bodies that burst: rings and cylinders whose strengths scatter."""
import math
from pathlib import Path

import numpy as np

from pdhpc.scene.read import read_scene
from pdhpc.study.verify.case import Check, alone, at_most, case, simulation_of

SCENE = Path(__file__).resolve().parents[3] / "runs" / "fragmenting_cylinder.toml"
SHORT = [
    "particles.spacing=1.25e-3", "particles.horizon=3.75e-3", "body.cylinder.start=[0.0, 0.0, -0.01]", "body.cylinder.end=[0.0, 0.0, 0.01]", "time.end=40e-6",
    "output.frames=1", "output.pictures=false",
]
HORIZON, CRITICAL, MODULUS, DENSITY, RADIUS, WIDTH = 3e-3, 0.02, 195e9, 7800.0, 0.1, 5e-3
RING = f"""
dimension = "plane_strain"
[particles]
spacing = {HORIZON / 3}
horizon = {HORIZON}
[[material]]
name = "steel"
density = {DENSITY}
youngs_modulus = {MODULUS}
critical_stretch = {CRITICAL}
{{scatter}}
[[body]]
name = "ring"
material = "steel"
shape = "disk"
center = [0.0, 0.0]
radius = {RADIUS}
[[body.hole]]
shape = "disk"
center = [0.0, 0.0]
radius = {RADIUS - WIDTH}
[[initial]]
radial_velocity = [{{speed}}]
[fragments]
damage = 0.5
particles = 5
[time]
end = {{end}}
[output]
frames = 1
pictures = false
"""


def _burst(rate, scatter):
    """Return (record, momentum, mass), see _kept, of a ring that expands at a rate, 1/s."""
    text = RING.format(scatter=scatter, speed=rate * RADIUS, end=6 * CRITICAL / rate + 10e-6)
    simulation = simulation_of(text)
    record = simulation.run(quiet=True)
    return record, *_kept(simulation, record)


def _kept(simulation, record):
    """Return (momentum over that of all particles if they went one way, mass of fragments and dust over the body's) at the end of a run."""
    particles, found = simulation.problem.subdomain.particles, record["fragments"]
    mass, velocity = DENSITY * particles.owned(particles.volume), particles.owned(particles.velocity)
    held = sum(each["mass"] for each in found["heaviest"]) / mass.sum() + found["dust"]
    return float(np.abs(velocity.T @ mass).max() / (np.linalg.norm(velocity, axis=1) @ mass)), held


def numbers_of_fragments(rate):
    """Return how many fragments of the ring Grady (1982) and Zhou, Molinari & Ramesh (2006) expect at a rate, 1/s.

    Grady: kinetic energy alone opens the cracks, s = (24 G/(rho rate^2))^(1/3), the largest size. Zhou et al., of simulated brittle rings of one strength:
    s = 4.5 L/(1 + 0.77 r^(1/4) + 5.4 r^(3/4)), L = E G/sigma_c^2, r = rate L/(c sigma_c/E), c = sqrt(E/rho), sigma_c = E s0.
    G of plane strain: s0 = sqrt(5 pi G/(12 E delta)).
    """
    toughness = CRITICAL**2 * 12 * MODULUS * HORIZON / (5 * math.pi)
    length = toughness / (MODULUS * CRITICAL**2)
    reduced = rate * length / (math.sqrt(MODULUS / DENSITY) * CRITICAL)
    around = 2 * math.pi * (RADIUS - WIDTH / 2)
    sizes = (24 * toughness / (DENSITY * rate**2)) ** (1 / 3), 4.5 * length / (1 + 0.77 * reduced**0.25 + 5.4 * reduced**0.75)
    return tuple(around / size for size in sizes)


@case
def fragments_of_a_ring():
    """a ring bursts into the more fragments the faster it expands; mass and momentum are kept"""
    checks, counts, rates = [], [], (1000.0, 2000.0, 4000.0, 8000.0)
    for rate in rates:
        record, momentum, mass = _burst(rate, "weibull_modulus = 10\nweibull_length = 5e-3")
        counts.append(record["fragments"]["count"])
        fewest, most = numbers_of_fragments(rate)
        middle, half = 0.5 * (fewest + most), 0.5 * (most - fewest)
        checks.append(Check(f"{rate:g}/s: fragments, between both estimates", counts[-1], middle, half, "Grady 1982; Zhou, Molinari & Ramesh 2006", relative=False))
        checks.append(Check(f"{rate:g}/s: mass of fragments and dust over the ring's", mass, 1.0, 1e-12, "counted once"))
        checks.append(at_most(f"{rate:g}/s: momentum, relative", momentum, 1e-13, "Newton's third law"))
        checks.append(at_most(f"{rate:g}/s: balance error over the largest energy", record["balance_error_relative"], 0.015, "first law"))
    exponent = float(np.polyfit(np.log(rates), np.log(counts), 1)[0])
    checks.append(Check("exponent of the number over the rate", exponent, 1 / 3, 1 / 3, "from 0, slow and brittle, to 2/3 of Grady's energy balance", relative=False))
    return checks


@case
def fragments_and_scatter():
    """the more strengths scatter, the fewer, larger and more unequal the fragments of a ring, and the less dust"""
    rows = []
    for modulus in (40, 10, 4):
        found = [_burst(2000.0, f"weibull_modulus = {modulus}\nweibull_length = 5e-3\nweibull_seed = {seed}")[0]["fragments"] for seed in (1, 2, 3)]
        masses = [np.array([each["mass"] for each in one["heaviest"]]) for one in found]
        rows.append([np.mean([one["count"] for one in found]), np.mean([one["largest"] for one in found]),
                     np.mean([each.std() / each.mean() for each in masses]), np.mean([one["dust"] for one in found])])
    names = "fewer fragments", "a larger largest one", "more unequal ones", "less dust"
    steps = np.diff(rows, axis=0) * (-1, 1, 1, -1)
    return [Check(f"{name} at modulus 10 than at 40, and at 4 than at 10; means of three rings", float((step > 0).sum()), 2.0, 0.0, "Mott 1947; Zhou & Molinari 2004")
            for name, step in zip(names, steps.T)]


@case
def fragmenting_cylinder():
    """the scene runs/fragmenting_cylinder.toml, a fifth as long and coarser: its initial energy, and mass, momentum and energy of what it breaks into"""
    simulation = alone(read_scene(SCENE, SHORT))
    particles = simulation.problem.subdomain.particles
    kinetic = 0.5 * (particles.owned(particles.velocity) ** 2).sum(axis=1).mean()
    record = simulation.run(quiet=True)
    found, (momentum, held) = record["fragments"], _kept(simulation, record)
    h = 0.2  # half of its length over a: means of ((200 - 50 x^2)^2 + (100 x)^2)/2 over -h < x < h
    expected = 0.5 * (200.0**2 - 2 * 200.0 * 50.0 * h**2 / 3 + 50.0**2 * h**4 / 5 + 100.0**2 * h**2 / 3)
    return [
        Check("kinetic energy per mass at the start, J/kg", float(kinetic), expected, 1e-4, "v_r = 200 - 50 (z/a)^2, v_z = 100 z/a"),
        Check("fragments", found["count"], 14.0, 6.0, "strips all around", relative=False),
        at_most("mass of the heaviest over the cylinder's", found["largest"], 0.2, "none spans a fifth"),
        Check("mass of fragments and dust over the cylinder's", held, 1.0, 1e-12, "counted once"),
        at_most("momentum, relative", momentum, 1e-13, "Newton's third law"),
        at_most("balance error over the largest energy", record["balance_error_relative"], 0.01, "first law"),
    ]
