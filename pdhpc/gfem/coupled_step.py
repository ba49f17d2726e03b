"""Finite elements enriched by local peridynamics: one coupled step, in five stages (Schweitzer, Wu).

    u^h = sum_i phi_i a_i + sum_{i in J} phi_i eta,   eta from particles that move for k sub-steps on the patches of J.
"""
import numpy as np

from pdhpc import state
from pdhpc.gfem.ghost_force import ghost_force
from pdhpc.gfem.patches import largest_principal_strains
from pdhpc.gfem.view import CoupledView
from pdhpc.kernels import blend
from pdhpc.kernels.motion import kinetic_energies
from pdhpc.mts.two_regions import Timer
from pdhpc.parallel.comm import largest


_SOON = 0.7  # of theta: cells strained beyond it join as soon as others do


class CoupledStep:
    """A body on a mesh, with particles where it fails.

    Attributes
    ----------
    patches : Patches. local : LocalParticles. solution : MeshSolution. scheme : Pinned, or another that fills the verbs in.
    dt, s, of a step of k sub-steps. step : number of steps done. view : what observers see.
    seconds : {name: wall seconds on this rank}, those of the local run under its own names.
    """

    def __init__(self, comm, patches, local, solution, scheme, activation):
        """activation : the share theta of the critical stretch at which a patch is chosen. Collective."""
        self.comm, self.patches, self.local, self.solution, self.scheme = comm, patches, local, solution, scheme
        self.dt, self.k, self.step, self._activation = scheme.dt, scheme.k, 0, activation
        self._hopeless, self._never_whole = None, patches.never_whole()[: solution.mesh.n_owned_cells]
        self._stages = dict.fromkeys(("choose", "seed", "reconstruct", "solve"), 0.0)
        self.view, self._limits = CoupledView(self), self._strain_limits()

    def advance(self):
        """Do one step from t_n to t_n + dt:

            choose        patches whose material is strained beyond theta s_c, or has broken bonds
            seed          local particles start from u^n, v^n; their collar follows the global solution
            run           k sub-steps of peridynamics on the patches
            reconstruct   eta from the particles
            solve         u^{n+1}, v^{n+1} in the enriched space

        Collective.
        """
        self.choose_patches()
        self.seed_particles()
        self.run_particles()
        eta = self.reconstruct()
        self.solve(eta)

    def choose_patches(self):
        """Add the patches of cells that want particles, and with them those of cells that soon will: patches then grow in fewer, larger steps.

        What is looked at are the forces at the start of the particles' run, which are evaluated again when patches are added.
        """
        with self._timed("choose"):
            self.local.put_collar(self.solution.displacement)
        self._start_particles()
        with self._timed("choose"):
            grown = largest(self.comm, int(self._wanting(self._activation).any())) and self._grow()
        if grown:
            self._start_particles()

    def seed_particles(self):
        """Start the particles from the global solution, which they hold, and tell the collar how it moves: a extrapolated to the middle of the step."""
        with self._timed("seed"):
            solution = self.solution
            self.local.hold_collar(solution.velocity, 1.5 * solution.acceleration - 0.5 * solution.previous_acceleration)

    def run_particles(self):
        """Let the particles move for k sub-steps."""
        self.local.run()

    def reconstruct(self):
        """Return eta, what the scheme enriches the space with."""
        with self._timed("reconstruct"):
            return self.scheme.reconstruct()

    def solve(self, eta):
        """Solve the global problem in the enriched space."""
        with self._timed("solve"):
            self.scheme.solve(eta, self.time)
            self.step += 1

    def follow(self):
        """Let everything follow the patches. Collective."""
        weight = self.scheme.weight(self.patches)
        self.local.follow(self.patches, weight, self.solution.displacement, self.solution.velocity)
        self.solution.follow(self.patches, weight)
        self.scheme.follow(self.patches)
        self.local.put_collar(self.solution.displacement)
        enriched = self.patches.enriched[: self.solution.mesh.n_owned_cells]
        self._free = np.flatnonzero(~enriched & np.isfinite(self._limits)).astype(np.int32)
        self._free_limits, self._strain = self._limits[self._free], np.empty(len(self._free))
        self.solution.evaluate(self.time)

    def _start_particles(self):
        self.local.start(self.k, self.dt / self.k, self.time, self._activation)

    def _grow(self):
        """Add patches, and let everything follow them; return whether there are new ones on any rank. Collective."""
        self._look_for_the_hopeless()
        self.local.look(_SOON * self._activation)
        grown = largest(self.comm, self.patches.add(self._wanting(_SOON * self._activation))) > 0
        if grown:
            self.follow()
        return grown

    def _look_for_the_hopeless(self):
        """Note where the body fails in cells that cannot be enriched: bonds broke on the ramp in them, or elements are strained beyond the limit. Local."""
        failing = self.local.wanting(np.inf)
        failing[self._free] |= self._strain > self._free_limits
        failing &= self._never_whole
        if failing.any() and self._hopeless is None:
            mesh = self.solution.mesh
            place = ", ".join(f"{x:.4g}" for x in mesh.points[mesh.cells[np.flatnonzero(failing)[0]]].mean(axis=0))
            self._hopeless = (f"the material failed near ({place}) m at t = {self.time:.6g} s, within two cells of where motion is prescribed, which particles"
                              " cannot follow: hold the body farther from there, let what is near never fail (damage.no_fail), or take model = \"particles\"")

    @property
    def time(self):
        """Time of the current state, s."""
        return self.step * self.dt

    def _strain_limits(self):
        """Return (n_owned_cells,), the smallest critical stretch of the particles of each cell that may fail; infinite where none may."""
        lattice, law = self.local.lattice, self.local.law
        by_block = np.append(np.diag(law.break_at), np.inf)
        limits = np.empty(lattice.mesh.n_owned_cells)
        for cells in lattice.pieces():
            slots = lattice.slots_of(cells)
            limits[cells] = by_block[np.where(slots >= 0, self.local.original_block(slots), len(by_block) - 1)].min(axis=1)
        return limits

    def _wanting(self, share):
        """Return (n_owned_cells,) bool: cells on the ramp with particles strained beyond a share of their limit or broken, cells without if strained so."""
        mesh, free, strain = self.solution.mesh, self._free, self._strain
        wanted = self.local.wanting(share)
        largest_principal_strains(mesh.cells, free, self.local.lattice.corner_gradient, self.solution.displacement, strain)
        wanted[free] = strain > share * self._free_limits
        return wanted

    @property
    def seconds(self):
        """Wall seconds of this rank by kind of work."""
        return {**self.local.seconds, **self._stages}

    @property
    def parts(self):
        """The subdomain of this rank."""
        return (self.local.subdomain,)

    @property
    def broken(self):
        """Directed bonds of this rank that broke so far."""
        return self.local.broken

    @property
    def bond_evaluations(self):
        """Directed bonds that this rank evaluated so far: {"body"}."""
        return {"body": self.local.bond_evaluations}

    @property
    def bytes_sent(self):
        """Bytes that this rank sends per sub-step to refresh ghosts."""
        return self.local.bytes_sent

    @property
    def failure(self):
        """None, or why the run cannot go on: a solver that did not converge, or material that fails where no patch can be."""
        return self.scheme.mass.failure or self._hopeless

    def ledger(self):
        """Return {name: (n,) J} of this rank's contributions to the energies. Local.

        Particles of enriched cells count with the energies of their bonds, shared by (alpha_p + alpha_q)/2, elements with 1 - alpha; outside the patches
        particles are elements only.
        """
        local, particles = self.local, self.local.subdomain.particles
        slots = local.cell_slots.ravel()
        kinetic, strain = np.empty(len(slots)), np.empty(len(slots))
        kinetic_energies(particles.velocity, particles.volume, particles.block, local.law.density, slots, kinetic)
        blend.blended_energies(local.subdomain.bonds.arrays, local.subdomain.points, local.law, particles.third, slots, local.alpha, strain)
        return {
            "kinetic_energy": np.concatenate([self.solution.kinetic_energies(), kinetic]),
            "strain_energy": np.concatenate([self.solution.strain_energies(), strain * local.volume]),
            "dissipated_energy": particles.dissipated[slots],
            "external_work": np.concatenate([self.solution.external_work(), local.external_work()]),
        }

    def ghost_force(self):
        """Return the largest force on a vertex inside the body under uniform strain, over sigma H: 0 if the blend were perfect. Collective."""
        found = largest(self.comm, ghost_force(self.local, self.solution))
        self.solution.evaluate(self.time)
        return found

    def resume(self):
        """Bring everything that follows from the state up to date, after a state was put in. Collective."""
        solution, particles, bonds = self.solution, self.local.subdomain.particles, self.local.subdomain.bonds
        entries = self._kept_entries()
        kept_values = {key: entry.get() for key, entry in entries.items()}
        solution.refresh("displacement", "velocity", "acceleration", "previous_acceleration")
        solution.first = self.step == 0
        kept = [(field, particles.owned(field).copy()) for field in (particles.position, particles.velocity)]
        self.follow()
        for field, values in kept:  # of particles that the mesh has just given its own
            particles.put(field, values)
        self.local.blended.seen[:] = True  # bonds may have broken in the step before
        self.local.refresh()
        self.scheme.settle()
        solution.evaluate(self.time)
        self.local.broken = int((bonds.initial_size - bonds.alive()).sum())
        for key, entry in entries.items():
            entry.set(kept_values[key])

    def state(self):
        """Return {key: Entry} of everything a continued run needs; after the last is set, `resume`."""
        solution, particles, bonds = self.solution, self.local.subdomain.particles, self.local.subdomain.bonds
        n = solution.mesh.n_owned
        ids = solution.mesh.vertex_id[:n]
        entries = {"step": state.number(self, "step", int)}
        entries["mesh/patches"] = state.Entry(lambda: self.patches.chosen[:n], self.patches.restore, ids)  # setting it is collective over neighbours
        for name in ("displacement", "velocity", "acceleration", "previous_acceleration"):
            entries[f"mesh/{name}"] = state.Entry(lambda name=name: getattr(solution, name)[:n], lambda value, name=name: np.copyto(getattr(solution, name)[:n], value), ids)
        for name in ("position", "velocity", "dissipated"):
            entries[f"particles/{name}"] = particles.entry(getattr(particles, name))
        entries["bonds"] = state.Entry(bonds.states, bonds.set_states, particles.id[: particles.n_owned])
        return {**entries, **self._kept_entries(), **solution.work_state(), **self.local.work_state()}

    def _kept_entries(self):
        """Return {key: Entry} of what following the patches anew must not change. Local."""
        entries = {f"particles/{name}": state.number(self.local, name, int, state.SUM) for name in ("bond_evaluations", "particle_steps")}
        entries["mesh/refused"] = state.number(self.patches, "refused", int, state.SUM)
        entries["scheme/lost"] = state.number(self.scheme, "lost", of=state.SUM)
        return {**entries, **self.scheme.entries()}

    def _timed(self, name):
        return Timer(self._stages, name)
