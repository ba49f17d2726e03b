"""Damage laws, surface corrections and bodies of several horizons: every digit as on one rank."""
import numpy as np
import pytest

from pdhpc.scene.read import parse_scene
from pdhpc.simulation import Simulation
from pdhpc.study.verify.case import plate

SECOND = """
[[material]]
name = "other"
density = 2.0
youngs_modulus = 3.0
{keys}
[[body]]
name = "right"
material = "other"
shape = "box"
lower = {lower}
upper = {upper}
horizon = 2.4
[[initial]]
velocity_gradient = {kick}
{more}
"""
CRACK = '[[crack]]\ntype = "polyline"\npoints = [[-3.0, -20.0], [-3.0, 1.0]]\n'
LPS = 'model = "lps"\npoissons_ratio = 0.1\n'
SOFTENS = "critical_stretch = 0.02\nstretch_softening = 0.5"
BY_ENERGY = 'energy_release_rate = 2e-3\nfailure = "energy"'


def state_of(comm, simulation):
    """Return {name: array sorted by id} of the whole body, on every rank."""
    subdomain = simulation.problem.subdomain
    particles = subdomain.particles
    parts = {"id": particles.id[: particles.n_owned], "alive": subdomain.bonds.alive()}
    for name in ("displacement", "velocity", "force_density", "dissipated"):
        parts[name] = particles.owned(getattr(particles, name))
    if len(subdomain.points.raised):
        parts["raised"] = particles.owned(subdomain.points.raised)
    if len(subdomain.points.strength):
        parts["strength"] = particles.owned(subdomain.points.strength)
    whole = {name: np.concatenate(comm.allgather(values)) for name, values in parts.items()}
    order = np.argsort(whole["id"])
    return {name: values[order] for name, values in whole.items()}


def same_as_on_one_rank(comm, text, overrides=()):
    """Run a scene on all ranks and on one; return the record and the final state after comparing every digit."""
    from mpi4py import MPI

    scene = parse_scene(text, "t", overrides)
    together, alone = Simulation(scene, comm), Simulation(scene, MPI.COMM_SELF)
    record, reference = together.run(quiet=True), alone.run(quiet=True)
    found, expected = state_of(comm, together), state_of(MPI.COMM_SELF, alone)
    for name, values in found.items():
        assert np.array_equal(values, expected[name]), name
    for name in ("energies", "broken_bonds", "bonds", "critical_dt", "dt", "path"):
        assert record[name] == reference[name], name
    assert record["ghosts"] > 0 and 0 < record["broken_bonds"] < record["bonds"]
    return record, found


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("keys, overrides", [
    (SOFTENS, ["particles.surface_correction=energy"]), (BY_ENERGY, ["particles.surface_correction=volume"]), (LPS + SOFTENS, []), (LPS + BY_ENERGY, []),
], ids=["pmb softens", "pmb by energy", "lps softens", "lps by energy"])
def test_two_horizons_with_every_damage_law(comm, keys, overrides):
    extra = SECOND.format(keys=keys, lower=[10.0, -6.0], upper=[22.0, 6.0], kick="[[0.03, 0.0], [0.02, -0.01]]", more=CRACK)
    record, found = same_as_on_one_rank(comm, plate((20, 12), 3.0, kinematics="finite", material=keys, extra=extra), ["time.end=12.0", *overrides])
    assert record["path"].startswith("cloud: ") and record["balance_error_relative"] < 0.2
    assert "raised" not in found or found["raised"].max() > 1e-3


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("model", ["", LPS])
def test_softening_on_a_lattice(comm, model):
    extra = "[[initial]]\nvelocity_gradient = [[0.03, 0.0], [0.02, -0.01]]\n" + CRACK
    record, found = same_as_on_one_rank(comm, plate((24, 12), 3.0, kinematics="finite", material=model + SOFTENS, extra=extra), ["time.end=12.0"])
    assert record["path"].startswith("lattice: ") and found["raised"].max() > 1e-3


@pytest.mark.mpi(min_size=2)
@pytest.mark.parametrize("path, model, length", [("lattice", "", "weibull_length = 2.5\n"), ("cloud", LPS, "")], ids=["lattice pmb of grains", "cloud lps"])
def test_scattered_strengths(comm, path, model, length):
    """Ranks draw the strengths of what they own and of ghosts from ids and places alone."""
    extra = "[[initial]]\nvelocity_gradient = [[0.012, 0.0], [0.0, 0.009]]\n"
    text = plate((24, 12), 3.0, kinematics="finite", material=model + "critical_stretch = 0.02\nweibull_modulus = 4\n" + length, extra=extra)
    record, found = same_as_on_one_rank(comm, text, ["time.end=3.0", f"particles.path={path}"])
    kinds = len(np.unique(found["strength"]))
    assert record["path"].startswith(path) and found["strength"].std() > 0.15 and (kinds == 288 if not length else 24 < kinds < 100)


@pytest.mark.mpi(min_size=2)
def test_an_interface_without_bonds_in_three_dimensions(comm):
    kick = "[[0.03, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.01, -0.01]]"
    words = '[[interface]]\nbodies = ["body", "right"]\nbonds = "none"\n'
    extra = SECOND.format(keys=SOFTENS, lower=[4.0, -3.0, -3.0], upper=[8.0, 3.0, 3.0], kick=kick, more=words)
    text = plate((8, 6, 6), 2.0, kinematics="finite", material=SOFTENS, dimension="3d", extra=extra)
    same_as_on_one_rank(comm, text, ["time.end=6.0", "particles.surface_correction=energy", "particles.influence=conical"])
