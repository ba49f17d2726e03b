"""What the velocity gap does to the multipliers: H x = r, and the response of the regions to x. Three operators with one face: Exact, Polynomial, Kick.

    H = dT/2 C M_A^-1 C^T + C V C^T,   V x = velocity after m sub-steps from rest under the ramp (j/m) M_B^-1 C^T x   (shared notation of macro_step.py)

`solve` returns x, the change of the multipliers, at the fine copies; `respond` adds the linear response of both regions to x.
"""
import numpy as np

from pdhpc.kernels import overlap as loops
from pdhpc.mts.ramp_response import chord, largest_z, response_polynomials
from pdhpc.state import Entry


class _Operator:
    """What the operators share."""

    keeps_multipliers = True
    iterations = 0  # of the last solve
    bond_evaluations = 0
    _solver = None

    def __init__(self, interface, macro_dt, m):
        self.interface, self.macro_dt, self.m = interface, macro_dt, m
        total = interface.coarse_mobility + interface.fine.mobility
        self.diagonal = 0.5 * macro_dt * np.where(total > 0.0, total, 1.0)  # D; a component held in both copies has no gap

    def slow_coarse(self, x):
        """Let the coarse region respond: one step, so v -= dT/2 M_A^-1 C^T x and a -= M_A^-1 C^T x (x at the coarse copies). Local."""
        coarse = self.interface.coarse
        velocity = coarse.subdomain.particles.velocity
        velocity[coarse.slots] -= 0.5 * self.macro_dt * coarse.mobility * x
        coarse.subdomain.particles.force_density[coarse.slots] -= x / coarse.share[:, None]

    @property
    def failure(self):
        """None, or what the first solve that failed has to say."""
        return getattr(self._solver, "failure", None)

    def state(self):
        """Return {key: Entry} of what a continued run needs. Local."""
        return {}

    def velocity_offset(self):
        """Return what to add to the fine copies' velocities for the velocity of the body, m/s. Local."""
        return 0.0


class _OnStrip(_Operator):
    """An operator that sweeps over a strip of the fine region."""

    def __init__(self, interface, macro_dt, m, strip, forces, held):
        """strip : Strip. forces : LinearForces. held : [(slots, components)] of the fine region's prescribed motions."""
        super().__init__(interface, macro_dt, m)
        self.strip, self.forces = strip, forces
        fine = interface.fine
        self._particles = fine.subdomain.particles
        density = np.zeros(256)
        density[: len(fine.law.density)] = fine.law.density
        self._density, self._ones = density, np.ones(256)
        self._inverse_density = np.where(density > 0.0, 1.0 / np.where(density > 0.0, density, 1.0), 0.0)
        by_slot = np.zeros((len(self._particles.position), interface.dim), bool)
        for slots, components in held:
            by_slot[np.ix_(slots, components)] = True
        self._held = [by_slot[slots] for slots in strip.slots]
        self._bonds = strip.bonds_per_level(fine.subdomain)
        self._reach = 1 if fine.subdomain.state is None else 2  # in family radii, of the forces that a particle's motion causes
        self.bond_evaluations = 0

    def _load(self, x):
        """Set w = M_B^-1 C^T x on the overlap, 0 elsewhere."""
        loops.put_rows(self.forces.w, self.interface.fine.slots, self.interface.fine.mobility * x)

    def _clear(self):
        loops.clear_rows(self.forces.w, self.strip.slots[-1], self.interface.dim)

    def _apply(self, level):
        """Store -K w in the rows of a level."""
        level = min(level, len(self.strip.rows) - 1)
        self.forces.apply(self.strip.rows[level], self.strip.rows[min(level + 1, len(self.strip.rows) - 1)])
        self.bond_evaluations += self._bonds[level]


class Exact(_OnStrip):
    """H itself on a strip of two horizons, of more where waves get farther in dT, by CG (KSP `interface_`), preconditioned by D = dT/2 (M_A^-1 + M_B^-1).

    Costs (m - 1) sweeps over the strip in each iteration and once more for the response.
    """

    name = "exact"

    def __init__(self, interface, macro_dt, m, strip, forces, held, make_solver, horizons=2):
        """make_solver : function (n_local, apply, diagonal) -> solver with solve(r) -> x and `iterations`. horizons : width of the strip beyond the overlap."""
        super().__init__(interface, macro_dt, m, strip, forces, held)
        self._level = horizons * self._reach
        self._slots = strip.slots[self._level]
        count = (len(self._slots), interface.dim)
        self._u, self._v, self._a, self._ramp = (np.zeros(count) for _ in range(4))
        self._at = np.searchsorted(self._slots, interface.fine.slots)
        self._solver = make_solver(self.diagonal.size, self.apply, self.diagonal)

    def solve(self, gap):
        """Return x with H x = gap. Collective over the fine region's ranks."""
        x = self._solver.solve(gap.ravel()).reshape(gap.shape)
        self.iterations = self._solver.iterations
        return x

    def apply(self, x):
        """Return H x, flat or (n, dim). Collective over the fine region's ranks."""
        x = x.reshape(self.diagonal.shape)
        self._run(x)
        return 0.5 * self.macro_dt * self.interface.coarse_mobility * x + self._v[self._at]

    def respond(self, x):
        """Add the fine region's response to x: m - 1 linear sub-steps on the strip. Collective over the fine region's ranks."""
        self._run(x)
        particles = self._particles
        loops.add_response(particles.displacement, self._slots, self._u, self._ones, particles.block)
        loops.add_response(particles.velocity, self._slots, self._v, self._ones, particles.block)
        loops.add_response(particles.force_density, self._slots, self._a, self._density, particles.block)

    def _run(self, x):
        """Store the response (u, v, a) of the strip to the ramp of x."""
        self._u[...], self._v[...], self._a[...], self._ramp[...] = 0.0, 0.0, 0.0, 0.0
        self._ramp[self._at] = self.interface.fine.mobility * x
        dt, forces, particles = self.macro_dt / self.m, self.forces, self._particles
        for j in range(1, self.m + 1):
            loops.drift_response(forces.w, self._slots, self._u, self._v, self._a, dt)
            if j > 1:
                self._apply(self._level)
            loops.kick_response(self._ramp, j / self.m, forces.force_density, self._slots, self._inverse_density, particles.block, self._held[self._level],
                                self._v, self._a, dt, j > 1)


class Polynomial(_OnStrip):
    """An operator above H that needs p + q sweeps over the strip whatever m is, and the response by polynomials of degree p.

    x = sum_{j <= q} (D^-1 R)^j D^-1 r with R t = dT/2 c dT^2 C M_B^-1 K_B M_B^-1 C^T t: Richardson's iteration of q + 1 steps on D - R, Jacobi D (KSP
    `interface_`). w_0 = M_B^-1 C^T x, w_{k+1} = dT^2 M_B^-1 K_B w_k;  u += dT^2 sum c^u_k w_k, v += dT sum c^v_k w_k, a += sum c^a_k w_k.
    """

    name = "polynomial"

    def __init__(self, interface, macro_dt, m, strip, forces, held, make_solver, critical_dt, degree=2):
        """critical_dt : s, of the fine region. degree : p."""
        super().__init__(interface, macro_dt, m, strip, forces, held)
        z = largest_z(macro_dt, critical_dt)
        self._chord = chord(m, z)
        self._coefficients = response_polynomials(m, degree, z)
        self._solver = make_solver(self.diagonal.size, self.apply, self.diagonal)

    def solve(self, gap):
        """Return x, about H^-1 gap. Collective over the fine region's ranks."""
        if self.m == 1:
            return gap / self.diagonal
        self._clear()
        x = self._solver.solve(gap.ravel()).reshape(gap.shape)
        self.iterations = self._solver.iterations
        return x

    def apply(self, t):
        """Return (D - R) t, flat or (n, dim). Collective over the fine region's ranks."""
        t = t.reshape(self.diagonal.shape)
        if self.m == 1:
            return self.diagonal * t
        fine = self.interface.fine
        self._load(t)
        self._apply(0)
        stiff = self.forces.force_density[fine.slots] * fine.mobility * fine.share[:, None]  # -M_B^-1 K_B M_B^-1 C^T t
        return self.diagonal * t + 0.5 * self.macro_dt * self._chord * self.macro_dt**2 * stiff

    def respond(self, x):
        """Add the fine region's response to x. Collective over the fine region's ranks."""
        particles, forces, dT = self._particles, self.forces, self.macro_dt
        self._clear()
        self._load(x)
        c_u, c_v, c_a = self._coefficients
        for k in range(len(c_u)):
            level = min(k * self._reach, len(self.strip.slots) - 1)
            slots = self.strip.slots[level]
            if k > 0:
                self._apply(level)
                loops.accelerate_rows(forces.w, slots, -(dT**2), forces.force_density, self._inverse_density, particles.block, self._held[level])
            loops.add_rows(particles.displacement, slots, dT**2 * c_u[k], forces.w, self._ones, particles.block)
            loops.add_rows(particles.velocity, slots, dT * c_v[k], forces.w, self._ones, particles.block)
            loops.add_rows(particles.force_density, slots, c_a[k], forces.w, self._density, particles.block)


class Kick(_Operator):
    """No multipliers between macro times: the velocity gap is reflected, J = G^-1 r, v_s -= 2 M_s^-1 B_s^T J, G = M_A^-1 + M_B^-1.

    Conserves sum_s 1/2 v'M v + 1/2 u'(K - dt_s^2/4 K M^-1 K) u for any m, split and mesh within each region's critical step.
    """

    name, keeps_multipliers = "kick", False

    def __init__(self, interface, macro_dt, m):
        super().__init__(interface, macro_dt, m)
        self._offset = np.zeros_like(self.diagonal)

    def state(self):
        """Return {key: Entry} of the velocities' offset. Local."""
        return {"kick/offset": Entry(lambda: self._offset, lambda value: setattr(self, "_offset", np.array(value)), self.interface.fine.ids)}

    def solve(self, gap):
        """Return 2 J/dT, what multipliers of this impulse would be. Local."""
        return gap / self.diagonal

    def velocity_offset(self):
        """Return what takes the fine copies back to half of their reflection, where both copies agree, m/s. Local."""
        return self._offset

    def respond(self, x):
        """Let the fine copies' velocities be reflected. Local."""
        fine = self.interface.fine
        fine.subdomain.particles.velocity[fine.slots] += self.macro_dt * fine.mobility * x
        self._offset = -0.5 * self.macro_dt * fine.mobility * x

    def slow_coarse(self, x):
        """Let the coarse copies' velocities be reflected. Local."""
        coarse = self.interface.coarse
        coarse.subdomain.particles.velocity[coarse.slots] -= self.macro_dt * coarse.mobility * x
