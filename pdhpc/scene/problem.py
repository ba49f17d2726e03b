"""What one rank needs to run a scene of particles, and what it says of itself in run.json."""
from dataclasses import dataclass
from typing import Callable, List, Optional

import numpy as np

from pdhpc.observers.coupling import Coupling, CouplingGuard
from pdhpc.observers.impactors import ImpactorGauge
from pdhpc.parallel.comm import largest
from pdhpc.scene.amounts import amounts_of
from pdhpc.scene.body import Body, select
from pdhpc.scene.settings import contact_values, impactor_values, strengths
from pdhpc.scene.parts import Part
from pdhpc.scene.regions import Regions


class Uncoupled:
    """What a problem says whose parts, if it has several, are not coupled."""

    def coupling(self, stepper, comm):
        """Return the gauge of what couples the parts, or None. Collective."""
        return None

    def supports(self, comm, name):
        """Return what holds a region, other than the particles or vertices in it: (n,) owned vertices of elements, or None. Collective."""
        return None

    def guards(self, stepper, comm, steps):
        """Return the observers that stop a run whose coupling fails, at `steps` and in between. Local."""
        return []

    def outputs(self, comm, directory):
        """Return the observers that write what only this kind of problem has into a run's folder. Local."""
        return []

    def coupled(self, stepper, comm, coupling):
        """Return what run.json says of the coupling (the gauge that `coupling` returned), or None. Collective."""
        return None

    def remarks(self, comm):
        """Return sentences on what happened in a run that its user should know. Collective."""
        return []


@dataclass
class Problem(Uncoupled):
    """Everything one rank needs to run a scene.

    parts : the body, or its coarse and its fine region. dt : s, of the body, or of the coarse region: the macro step. critical_dt : s, of the body, or the
    smaller one of the regions'. make_stepper : function dt -> what advances. regions : with a fine region. m : steps of the fine region in one of these; 1 without one.
    """

    scene: object
    body: Body
    parts: List[Part]
    critical_dt: float
    dt: float
    m: int
    n_steps: int
    warnings: List[str]
    make_stepper: Callable
    regions: Optional[Regions] = None

    @property
    def subdomain(self):
        """Subdomain of the first part."""
        return self.parts[0].subdomain

    @property
    def exchange(self):
        """GhostExchange of the first part."""
        return self.parts[0].exchange

    @property
    def conditions(self):
        """Conditions of the first part."""
        return self.parts[0].conditions

    def stepper(self):
        """Return what advances this problem from t = 0: a VelocityVerlet or a stepper of mts/. Collective."""
        return self.make_stepper(self.dt)

    def members(self, view, comm, name, key):
        """Return the particles of a view in a region as indices; `key` names the region in an error. Collective."""
        inside, number = np.zeros(len(view.ids), bool), self.body.number_of(view.ids)
        for part in self.parts:
            inside |= select(self.scene, part.body, name, view.places(), number, view.ids)
        members = np.flatnonzero(inside)
        if comm.allreduce(len(members)) == 0:
            raise self.scene.error(key, f'"{name}", which selects no particle', "a region that holds at least one")
        return members

    def sizes(self, stepper, comm):
        """Return what run.json says of the body. Collective."""
        view = stepper.view
        n_particles, n_bonds = (int(number) for number in comm.allreduce(np.array([view.n, view.directed_bonds()])))
        return {
            "particles": n_particles,
            "bonds": n_bonds // 2,
            "path": self.body.path,
            "neighbours_largest": int(largest(comm, max(int(part.subdomain.bonds.family_size.max(initial=0)) for part in self.parts))),
            "bodies": [each._asdict() for each in amounts_of(self.scene, self.body, self.parts, comm)],
            "materials": strengths(self.body),
        }

    def share(self):
        """Return {what: number} of this rank's part of the body, for the log. Local."""
        names = ("coarse ", "fine ") if len(self.parts) > 1 else ("",)
        return {f"{name}{what}": number for name, part in zip(names, self.parts) for what, number in (
            ("particles", part.subdomain.particles.n_owned), ("ghosts", part.subdomain.particles.n_ghost), ("directed bonds", part.subdomain.bonds.n_directed))}

    def work(self, stepper, comm, seconds):
        """Return what run.json says of the work done in `seconds` of stepping, the mean over ranks. Collective."""
        per_rank = [sum(steps * part.subdomain.bonds.n_directed for steps, part in zip((1, self.m), self.parts)),
                    sum(part.subdomain.particles.n_ghost for part in self.parts), sum(part.exchange.sent for part in self.parts)]
        per_rank = np.array(comm.allgather(per_rank))
        evaluations = sum(int(comm.allreduce(count)) for count in stepper.bond_evaluations.values())
        n_particles = comm.allreduce(stepper.view.n)
        return {
            "bond_evaluations": evaluations,
            "particle_steps_per_second_and_core": n_particles * stepper.step / (seconds * comm.size) if seconds > 0 else None,
            "ghosts": int(per_rank[:, 1].sum()),
            "sent_per_step": int(per_rank[:, 2].sum()),
            "bytes_sent_per_step": int(comm.allreduce(stepper.bytes_sent)),
            "bond_imbalance": float(per_rank[:, 0].max() / max(per_rank[:, 0].mean(), 1)),
            **self._contact(comm),
            **self._impactors(stepper, comm),
        }

    def _contact(self, comm):
        """Return what run.json says of contact: what "auto" is, lists made, near pairs (each counted at both ends), ghosts of the last one; nothing without. Collective."""
        if self.scene.contact is None:
            return {}
        contact = self.conditions.interactions[0]
        pairs, ghosts = (int(number) for number in comm.allreduce(np.array([contact.near_pairs, contact.ghosts])))
        return {"contact": {**contact_values(self.scene, self.body), "lists_made": contact.lists_made, "near_pairs": pairs, "ghosts": ghosts}}

    def _impactors(self, stepper, comm):
        """Return what run.json says of impactors: where they are, how fast, the force of the body on them, and their stiffness; nothing without. Collective."""
        if not self.scene.impactor:
            return {}
        return {"impactors": [{**ImpactorGauge(comm, table.name, self.scene.dim).vectors(stepper), "stiffness": impactor_values(self.scene, self.body, table)}
                              for table in self.scene.impactor]}

    def coupling(self, stepper, comm):
        """Return the gauge of what couples the regions, or None. Collective."""
        return Coupling(comm, stepper) if hasattr(stepper, "operator") else None

    def guards(self, stepper, comm, steps):
        """Return the observers that stop a run whose coupling fails, at `steps` and in between. Local."""
        return [CouplingGuard(comm, steps)] if hasattr(stepper, "operator") else []

    def remarks(self, comm):
        """Return sentences on what happened in a run that its user should know, each once. Collective."""
        known = [part.conditions for part in self.parts if part.conditions is not None]  # local particles of finite elements have none
        mine = [sentence for conditions in known for each in conditions.interactions for sentence in each.warnings()]
        return list(dict.fromkeys(sentence for sentences in comm.allgather(mine) for sentence in sentences))

    def coupled(self, stepper, comm, coupling):
        """Return what run.json says of the regions and their coupling (the gauge that `coupling` returned); None without. Collective."""
        if coupling is None:
            return None
        evaluations, regions = {name: int(comm.allreduce(count)) for name, count in stepper.bond_evaluations.items()}, {}
        for name, part, steps in zip(("coarse", "fine"), self.parts, (1, self.m)):
            owned, bonds = comm.allreduce(np.array([part.subdomain.particles.n_owned, part.subdomain.bonds.n_directed]))
            ranks = int(comm.allreduce(int(part.subdomain.particles.n_owned > 0)))
            regions[name] = {"particles": int(owned), "directed_bonds": int(bonds), "dt": self.dt / steps, "critical_dt": part.critical_dt_of(comm), "ranks": ranks,
                             "bond_evaluations": evaluations[name]}
        return {
            "step_ratio": self.m,
            "interface": stepper.operator.name,
            "overlap_particles": int(comm.allreduce(len(stepper.interface.fine.slots))),
            "regions": regions,
            "bond_evaluations_interface": evaluations["interface"],
            "conserved_quantity_change": coupling.relative_change(),
            **{name: value for name, value in coupling.latest.items() if not name.startswith("bond_evaluations")},
        }
