"""The NaN guard: a run whose numbers are no longer finite stops and says where."""
from pdhpc.run import Observer, RunError


class FiniteGuard(Observer):
    """Check displacements every `every` steps and at the listed steps (those of output)."""

    def __init__(self, comm, steps, every=100):
        self.comm, self.steps, self.every = comm, steps, every

    def observe(self, stepper):
        """Stop on every rank when a displacement is NaN or infinite on any. Collective."""
        view = stepper.view
        mine = view.first_not_finite()
        bad = [each for each in [self.comm.allreduce(mine, op=_first)] if each is not None]
        if bad:
            raise RunError(
                f"the displacement of {view.carrier} {bad[0][0]} at {bad[0][1]} m is not finite at step {stepper.step}, t = {stepper.time:.6g} s"
                f" (checked every {self.every} steps): the step is too large or the loads are"
            )

    def finish(self, stepper):
        """Check the final state. Collective."""
        self.observe(stepper)


def _first(a, b):
    """Return the finding with the smaller id; None counts as no finding."""
    if a is None or b is None:
        return b if a is None else a
    return min(a, b)
