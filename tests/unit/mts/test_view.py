import numpy as np
import pytest

from pdhpc.study.verify.case import plate, problem_of
from pdhpc.study.verify.mts import coupled

NAMES = ("displacement", "velocity", "damage", "precrack", "force_density", "stress", "strain", "strain_energy_density", "active")
CRACK = '[[crack]]\ntype = "polyline"\npoints = [[-13.0, 0.0], [2.0, 0.0]]\n'


@pytest.mark.parametrize("path", ("lattice", "cloud"))
@pytest.mark.parametrize("kinematics", ("linear", "finite"))
def test_every_field_is_the_undivided_bodys(path, kinematics):
    """Of the same displacements, whose bonds break as the limits say, a body in two regions looks like the undivided one."""
    words, views = "critical_stretch = 0.02", []
    split = coupled(1, "polynomial", kinematics=kinematics, extra=CRACK, material=words, overrides=[f"particles.path={path}"])
    whole = problem_of(plate((24, 16), kinematics=kinematics, extra=CRACK, material=words), [f"particles.path={path}", f"time.dt={split.dt!r}", f"time.end={split.dt!r}", "time.allow_unstable=true"])
    for problem in (split, whole):
        for part in problem.parts:
            particles, places = part.subdomain.particles, part.subdomain.places()
            particles.put(particles.displacement, places * [0.019, -0.002] + 0.0004 * places**2)
            particles.put(particles.velocity, 1e-3 * places)
        stepper = problem.stepper()
        stepper.view.prepare()
        views.append(stepper.view)
    joined, plain = views
    order = np.argsort(joined.ids)
    assert np.array_equal(joined.ids[order], plain.ids) and joined.n == 24 * 16 and joined.directed_bonds() == plain.directed_bonds()
    assert joined.broken() == plain.broken() > 0
    assert np.array_equal(joined.places()[order], plain.places()) and joined.volume.sum() == pytest.approx(plain.volume.sum())
    for name in NAMES:
        values, expected = joined.field(name)[order], plain.field(name)
        assert values == pytest.approx(expected, abs=1e-11 * np.abs(expected).max()), name
    members, ahead = np.arange(24 * 16), plain.places()[:, 0]
    found = joined.foremost(members, joined.places()[:, 0], 0.1)
    assert joined.places([found])[0, 0] == plain.places([plain.foremost(members, ahead, 0.1)])[0, 0]
