"""When a list of near particles has to be made anew: before anything has moved half the skin."""
import math

import numpy as np

from pdhpc.kernels.contact import largest_motion

_MOST = 10  # steps from one look at the motion to the next, at most
_WILD = 1e9  # times half the skin: nothing sane moves that far between two looks
_FASTER = 2.0  # how much faster than now the fastest particle may become until the next look


class Watch:
    """Looks at how far particles moved since the list was made, at steps that it plans ahead from their largest speed v:

        steps to the next look = (skin/2 - moved) / (2 v dt), at least 1 and at most 10;  the list is made anew when moved + 2 v dt > skin/2.

    The largest motion is the same on any number of ranks, and with it every decision: ranks agree at these looks and at no other step.

    Attributes
    ----------
    overrun : the largest share of skin/2 that anything had moved, about, in a step that used an old list; above 1 pairs may have been missed.
    """

    def __init__(self, particles, skin, dt, agree):
        """skin : m. agree : function (3,) floats -> the largest of each over all ranks that share the list, or what a single rank needs: itself."""
        self.particles, self.half, self.dt, self.agree = particles, 0.5 * skin, dt, agree
        self.overrun, self.largest, self._left, self._planned = 0.0, 0.0, 0, 1
        self._before = None

    def due(self, also=0.0, speed=0.0, measure=None):
        """Return whether the list must be made anew now; it is then taken as made. Collective where `agree` is, at the same steps on all ranks.

        also : m that something else in the list moved since it was made; speed : m/s, its speed. measure : None, or function -> a number of which
        `largest` becomes the largest over ranks at every look.
        """
        self._left -= 1
        if self._left > 0:
            return False
        first = self._before is None
        if first:
            self._before = np.copy(self.particles.displacement)
        moved, fastest = self._motion()
        found = self.agree(np.array([max(moved, also), max(fastest, speed), 0.0 if measure is None else measure()]))
        moved, fastest, self.largest = (float(x) for x in found)
        self._left, step = 1, _FASTER * fastest * self.dt
        if not moved + step < _WILD * self.half:  # numbers that are no longer sane: whoever guards the run will say so
            return False
        if self._planned > 1:  # the list served until the step before this look
            self.overrun = max(self.overrun, (moved - fastest * self.dt) / self.half)
        anew = first or moved + step > self.half
        if anew:
            np.copyto(self._before, self.particles.displacement)
            moved = 0.0
        if step > 0.0 and not first:  # motions that are prescribed show in the velocities after the first step
            self._left = int(min(_MOST, max(1.0, (self.half - moved) / step)))
        self._planned = self._left
        return anew

    def restart(self):
        """Let the list be made anew at the next call of `due`. Local; on all ranks or none."""
        self._before, self._left, self._planned = None, 0, 1

    def _motion(self):
        """Return (largest displacement since the list was made, m, largest speed, m/s) of this rank's particles."""
        particles = self.particles
        moved2, speed2 = largest_motion(particles.displacement, self._before, particles.velocity, particles.slots)
        return math.sqrt(moved2), math.sqrt(speed2)
