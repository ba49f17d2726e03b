"""When a list of near particles has to be made anew: before anything has moved farther than the list allows it."""
import numpy as np

from pdhpc.kernels.contact import allow, largest_motion

_MOST = 10  # steps from one look at the motion to the next, at most
_LEAST = 3  # steps from one measurement to the next, at least: a pair that bounces is pressed for longer
_WILD = 1e9  # times half the skin: nothing sane moves that far between two looks
_FASTER = 2.0  # how much faster than now the fastest particle may become until the next look
_SERVES = (64, 32, 16, 8, 4, 2)  # steps that a list is meant to serve fast particles
_LARGEST = 10.0  # times half the skin: the most that one is allowed to move
_GROWTH = 1.5  # how many times as many pairs may be listed for their sake


class Watch:
    """Looks at how far particles moved since the list was made, which holds all that is nearer than allowances a_i + a_j beyond the distance that counts:

        a_i = skin/2; or, where few particles are fast, so that the list serves N steps: max(skin/2, min(N v_i dt, 5 skin)), N the largest of 64, 32, ..., 2 with which
              at most half as many pairs again are listed.
        The list is made anew when some particle moved farther than a_i.
        Steps to the next look: min_i (a_i - moved_i)/(2 v dt), v the largest speed of all; at least 1 and at most 10.

    What decides is the same on any number of ranks that agree: at these looks and at no other step. Allowances are each rank's business.

    Attributes
    ----------
    allowance : (n_owned,), m, a_i of the list at hand. overrun : the largest share of a_i that anything had moved, about, in a step that used an old list; above 1
    pairs may have been missed. largest : of what was measured at the last look.
    """

    def __init__(self, particles, skin, dt, agree, distance=None):
        """skin : m. agree : function (5,) floats -> the largest of each over all ranks that share the list, or what a single rank needs: itself.

        distance : m, within which particles touch, where fast ones are to have a larger allowance.
        """
        self.particles, self.half, self.dt, self.agree, self.distance = particles, 0.5 * skin, dt, agree, distance
        self.allowance = np.full(particles.n_owned, self.half)
        self.overrun, self.largest, self._left, self._planned, self._unmeasured = 0.0, 0.0, 0, 1, 0
        self._before = None

    def due(self, also=0.0, speed=0.0, measure=None):
        """Return whether the list must be made anew now; it is then taken as made. Collective where `agree` is, at the same steps on all ranks.

        also : m that something else in the list moved since it was made, which is allowed half the skin; speed : m/s, its speed. measure : None, or function -> a
        number of which `largest` becomes the largest over ranks, at looks 3 steps or more after the last measurement, and 0 at others.
        """
        self._left -= 1
        if self._left > 0:
            return False
        first = self._before is None
        if first:
            self._before = np.copy(self.particles.displacement)
        moved, fastest, least, before_last = self._motion()
        least, before_last = min(least, self.half - also), max(before_last, (also - speed * self.dt) / self.half)
        found = self.agree(np.array([max(moved, also), max(fastest, speed), -least, before_last, self._measured(measure)]))
        moved, fastest, missing, before_last, self.largest = (float(x) for x in found)
        self._left, step = 1, _FASTER * fastest * self.dt
        if not moved + step < _WILD * self.half:  # numbers that are no longer sane: whoever guards the run will say so
            return False
        if self._planned > 1:  # the list served until the step before this look
            self.overrun = max(self.overrun, before_last)
        anew = first or missing > 0.0
        if anew:
            np.copyto(self._before, self.particles.displacement)
            self._allow()
            missing = -self.half
        if step > 0.0 and not first:  # motions that are prescribed show in the velocities after the first step
            self._left = int(min(_MOST, max(1.0, -missing / step)))
        self._planned = self._left
        return anew

    def restart(self):
        """Let the list be made anew at the next call of `due`. Local; on all ranks or none."""
        self._before, self._left, self._planned = None, 0, 1

    def _allow(self):
        """Allow each particle its way until the next list. Local."""
        if self.distance is None:
            return
        particles = self.particles
        for steps in (*_SERVES, 0):
            if allow(particles.velocity, particles.slots, steps * self.dt, self.half, _LARGEST * self.half, self.distance, self.allowance) <= _GROWTH:
                return

    def _measured(self, measure):
        """Return what is to be measured now, or 0. Local; at the same looks on all ranks."""
        self._unmeasured += self._planned
        if measure is None or self._unmeasured < _LEAST:
            return 0.0
        self._unmeasured = 0
        return measure()

    def _motion(self):
        """Return (largest displacement since the list was made, m, largest speed, m/s, what is left of the least allowance, m, the share used before the last step)."""
        particles = self.particles
        return largest_motion(particles.displacement, self._before, particles.velocity, particles.slots, self.allowance, self.dt)
