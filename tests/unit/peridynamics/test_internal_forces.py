import numpy as np
import pytest

from pdhpc.peridynamics.internal_forces import InternalForces
from pdhpc.warm_up import MODELS, PATHS, NoGhosts, block


class Recorder:
    """Stands in for bound fields: writes down who does what when."""

    def __init__(self, log):
        self.log, self.fields = log, []

    def bind(self, field):
        self.fields.append(field)
        name, log = f"field {len(self.fields)}", self.log

        class Bound:
            bytes_sent = 8 * field.shape[1]

            def start_refresh(self):
                log.append((name, "start"))

            def finish_refresh(self):
                log.append((name, "finish"))

        return Bound()


def shaken(path, model, dim=2):
    subdomain, law = block(dim, 6, 2.0, False, path, model)
    particles = subdomain.particles
    particles.put(particles.displacement, 1e-5 * np.random.default_rng(0).standard_normal((particles.n_owned, dim)))
    particles.place()
    law.break_at[:] = np.inf
    return subdomain, law


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("model, expected", [("pmb", 1), ("lps", 2)])
def test_each_sweep_does_the_interior_while_its_messages_travel(path, model, expected, monkeypatch):
    subdomain, law = shaken(path, model)
    log = []
    recorder = Recorder(log)
    internal = InternalForces(subdomain, law, recorder.bind)
    rows = np.concatenate(subdomain.rows)
    subdomain.rows = rows[::2].copy(), rows[1::2].copy()
    inner = internal._rows
    monkeypatch.setattr(internal, "_rows", lambda part, *rest: log.append(("interior", "border")[part]) or inner(part, *rest))
    assert internal.evaluate() == 0
    assert log == [step for n in range(1, expected + 1) for step in ((f"field {n}", "start"), "interior", (f"field {n}", "finish"), "border")]
    assert [field.shape[1] for field in recorder.fields] == [2, 1][:expected], "positions, and p of state-based laws"
    assert np.shares_memory(recorder.fields[0], subdomain.particles.position) and internal.bytes_sent == 8 * sum([2, 1][:expected])
    assert set(internal.seconds) == {"force", "exchange", "wait"} and internal.seconds["force"] > 0


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("dim", (2, 3))
def test_the_split_into_interior_and_border_changes_no_bit(path, model, dim):
    found = []
    for split in (slice(0, None), slice(1, None, 3)):
        subdomain, law = shaken(path, model, dim)
        law.break_at[:] = 1.02**2
        rows = np.concatenate(subdomain.rows)
        border = rows[split] if split.step else rows[:0]
        subdomain.rows = np.setdiff1d(rows, border).astype(np.int32), border.copy()
        broken = InternalForces(subdomain, law, NoGhosts).evaluate()
        particles = subdomain.particles
        found.append((particles.owned(particles.force_density).copy(), broken, subdomain.bonds.alive(), particles.owned(particles.dissipated).copy()))
    assert all(np.array_equal(a, b) for a, b in zip(*found)) and found[0][1] > 0


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("model", MODELS)
def test_momentum_balances_and_a_second_evaluation_finds_nothing_new(path, model):
    subdomain, law = shaken(path, model)
    law.break_at[:] = 1.02**2
    internal, particles = InternalForces(subdomain, law, NoGhosts), subdomain.particles
    assert internal.evaluate() > 0
    force = particles.owned(particles.force_density).copy()
    assert np.abs(force.sum(axis=0)).max() < 1e-13 * np.abs(force).sum()
    assert internal.evaluate() == 0 and np.array_equal(particles.owned(particles.force_density), force)
