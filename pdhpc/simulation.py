"""A scene run from start to end: builds it, drives it, writes its outputs and run.json.

    from pdhpc.simulation import Simulation
    record = Simulation.from_file("runs/glass_branching.toml").run("out")
"""
import contextlib
import platform
import time
import uuid
from pathlib import Path

import numpy as np

from pdhpc import __version__
from pdhpc.observers.checkpoint import Checkpoints
from pdhpc.observers.guard import FiniteGuard
from pdhpc.observers.output import FieldOutput, HistoryOutput, columns, steps_of
from pdhpc.observers.progress import Progress
from pdhpc.output.checkpoint import write_checkpoint
from pdhpc.output.fields import FieldWriter
from pdhpc.output.history import History
from pdhpc.output.log import LOG, RunLog
from pdhpc.output.record import Lock, OutputError, claim_directory, note_failure, write_json
from pdhpc.parallel.comm import agree_on_error, await_turn, on_root, world
from pdhpc.parallel.linear_solver import SolverError, start_petsc, unused_options
from pdhpc.provenance import checksums, commit, hosts_of, introduction, versions
from pdhpc.restart import go_on, remarks
from pdhpc.run import RunError, StopRequested, drive
from pdhpc.scene.build import build
from pdhpc.scene.gauges import make_fragments, make_gauges
from pdhpc.scene.mesh_rules import unused
from pdhpc.scene.read import parse_scene, read_text
from pdhpc.scene.room import check_room

_STEPPING = ("force", "exchange", "wait", "integrate", "contact", "choose", "seed", "reconstruct", "solve")  # phases of a step
_LARGE_BALANCE_ERROR = 0.02  # relative; a larger one is reported as a warning


class Simulation:
    """One scene on one communicator.

    Attributes
    ----------
    scene : Scene. problem : this rank's share. stepper : what advances it, at its current step. energies, probes, tips, fragments : gauges.
    hosts : {name: ranks}. files : {name: SHA-256} of those that the scene names. seconds : {phase: s}. warnings : [sentence].
    """

    def __init__(self, scene, comm=None, petsc_options=()):
        """Build the scene. Collective over `comm` (default: all ranks). petsc_options : words handed to PETSc, of which those that nothing used are a warning."""
        self._started = started = time.perf_counter()
        self.comm = world() if comm is None else comm
        check_room(scene, self.comm)
        self.scene, self._petsc_options, self._log = scene, petsc_options, None
        self.hosts, self.files, self._digest = hosts_of(self.comm), *on_root(self.comm, checksums, scene)
        self._commit, self._run, self._restarts, self._earlier = on_root(self.comm, commit), None, 0, {"mean": {}, "slowest": {}}
        LOG.debug("compiling kernels, or loading them")
        _compile_first_on_each_node(self.comm, scene)
        compiled = time.perf_counter()
        LOG.debug("setting up")
        self.problem = build(scene, self.comm)
        with _solver_errors():
            self.stepper = self.problem.stepper()
        self.energies, self.probes, self.tips = make_gauges(self.problem, self.stepper.view, self.comm)
        self.fragments = make_fragments(self.problem, self.comm)
        self.coupling = self.problem.coupling(self.stepper, self.comm)
        self.seconds = {"compile": compiled - started, "setup": time.perf_counter() - compiled}
        self.warnings = unused(scene) + list(self.problem.warnings)

    @classmethod
    def from_file(cls, path, overrides=(), comm=None):
        """Read a scene on rank 0 and build it. Collective."""
        return cls(read_on_root(path, overrides, world() if comm is None else comm), comm)

    def run(self, directory=None, overwrite=False, quiet=False):
        """Run to the end; with a directory write fields, history and run.json there. Collective.

        Returns
        -------
        dict, the content of run.json.

        Raises
        ------
        OutputError: the directory holds another run, or cannot be written. RunError: the run cannot go on.
        """
        if directory is None:
            return self._drive(None, self._observers(None, quiet))
        with self._alone(directory):
            on_root(self.comm, claim_directory, str(directory), overwrite)
            self._run = self.comm.bcast(uuid.uuid4().hex)
            with self._logged(directory):
                return self._drive(directory, self._observers(directory, quiet))

    def resume(self, directory, saved, quiet=False):
        """Go on from the newest of the checkpoints `saved` (restart.Saved) that can be read, and write to the same directory. Collective.

        Returns, Raises
        ---------------
        as run; OutputError: no checkpoint can be read, or none is of this scene.
        """
        with self._alone(directory), self._logged(directory):
            return self._drive(directory, self._restored(directory, saved, quiet), resumed=True)

    @contextlib.contextmanager
    def _alone(self, directory):
        """Keep other jobs from writing to the directory meanwhile. Collective."""
        lock = Lock()
        on_root(self.comm, lock.take, str(directory))
        warning = self.comm.bcast(lock.warning)
        self._warn([warning] if warning else [])
        try:
            yield
        finally:
            lock.release()

    @contextlib.contextmanager
    def _logged(self, directory):
        """Keep the log of the run meanwhile: how it began, and how it ended. Collective."""
        log = self._log = RunLog(self.comm, directory)
        try:
            for line in introduction(self):
                LOG.info(line)
            for warning in self.warnings:
                LOG.warning(warning)
            yield
            LOG.info(f"done: {self.stepper.step} steps, {time.perf_counter() - self._started:.1f} s in all")
        except StopRequested as stop:
            LOG.info(str(stop))
            raise
        except (RunError, OutputError) as error:
            LOG.error(str(error))
            raise
        except Exception:
            LOG.critical(f"rank {self.comm.rank} of {self.comm.size}", exc_info=True)
            raise
        finally:
            log.close()

    def _warn(self, sentences):
        """Take sentences that are new into run.json and the log. Local."""
        for sentence in sentences:
            if sentence not in self.warnings:
                self.warnings.append(sentence)
                LOG.warning(sentence)

    def _restored(self, directory, saved, quiet):
        """Return the observers of a run whose state is that of a checkpoint. Collective."""
        observers = self._observers(directory, quiet)
        entries = {key: entry for each in (self.stepper, *observers) for key, entry in each.state().items()}
        taken, warnings = go_on(self.comm, saved, self.problem, entries)
        self._run, self._restarts, self._earlier = taken.header.get("run"), taken.header.get("restarts", 0) + 1, taken.header.get("seconds", self._earlier)
        self._warn(taken.header.get("warnings", []) + warnings + on_root(self.comm, remarks, taken))
        LOG.info(f"goes on from step {self.stepper.step}")
        with _solver_errors():
            self.stepper.resume()
        for each in observers:
            self._warn(each.take_up(self.stepper))
        return observers

    def _drive(self, directory, observers, resumed=False):
        """Run to the end and return the content of run.json. Collective."""
        writes = directory is not None
        if writes:
            self._write(directory, self._record("running"))
        try:
            with _solver_errors():
                drive(self.stepper, self.problem.n_steps, observers, self.seconds, resumed)
        except BaseException as error:
            for each in observers:
                each.close()
            if writes and isinstance(error, (RunError, OutputError, StopRequested)):  # these are raised on every rank
                status = {"status": "stopped"} if isinstance(error, StopRequested) else {"error": str(error)}
                with contextlib.suppress(OutputError, RunError):
                    if getattr(self.stepper, "torn", False):
                        for each in observers:
                            each.salvage(self.stepper)
                    self._write(directory, {**self._record("failed"), **status})
            elif writes and isinstance(error, Exception):  # what others may not know of
                await_turn(self.comm, error)
                note_failure(directory, error, steps=self.stepper.step, time=self.stepper.time)
            raise
        if self.energies.latest and self.energies.relative_error() > _LARGE_BALANCE_ERROR:
            self._warn([f"the energy balance is off by {self.energies.relative_error():.1%} of the largest energy: run it once more with half of time.safety; what"
                        " remains is not of the step"])
        if self.coupling is not None:
            self._warn(self.coupling.warnings())
        self._warn(self.problem.remarks(self.comm) + unused_options(self._petsc_options) + ([] if self._log is None else self._log.warnings()))
        record = self._record("done")
        if writes:
            self._write(directory, record)
        return record

    def _observers(self, directory, quiet):
        """Return the observers, in their order."""
        problem, scene = self.problem, self.scene
        frames = steps_of(scene.output_times(), problem.dt, problem.n_steps)
        rows = steps_of(sorted(set(scene.history_times()) | set(scene.output_times())), problem.dt, problem.n_steps)
        guards = [FiniteGuard(self.comm, frames), *problem.guards(self.stepper, self.comm, frames)]
        observers = [*guards, *self.tips]
        coupling = [] if self.coupling is None else [self.coupling]
        if directory is not None:
            header = {"scene": scene.resolved(), "version": __version__, "ranks": self.comm.size}
            observers.append(FieldOutput(FieldWriter(self.comm, directory, header), scene.output.fields, frames, self._computed()))
            observers += problem.outputs(self.comm, directory)
            gauges = [self.energies, *coupling, *self.probes, *self.tips, *([] if self.fragments is None else [self.fragments])]
            observers.append(HistoryOutput(History(Path(directory) / "history.csv", columns(gauges), self.comm), gauges, rows))
            observers.append(Checkpoints(self.comm, self._saver(directory, observers, guards), scene.checkpoint, problem.n_steps))
        else:
            observers.append(HistoryOutput(_Nowhere(), [self.energies, *coupling], [problem.n_steps]))
        return observers + ([Progress(problem.n_steps, quiet)] if self.comm.rank == 0 else [])

    def _saver(self, directory, observers, guards):
        """Return the function that writes a checkpoint, of a state that the guards let pass: what is wrong must not take the place of what was right."""
        def save(stepper):
            for guard in guards:
                guard.observe(stepper)
            entries = {key: entry for each in (stepper, *observers) for key, entry in each.state().items()}
            header = {"step": stepper.step, "time": stepper.time, "dt": self.problem.dt, "scene": self.scene.given(), "scene_file": str(Path(self.scene.source).absolute()),
                      "scene_sha256": self._digest, "files": self.files, "petsc_options": list(self._petsc_options), "versions": versions(), "commit": self._commit,
                      "host": platform.node(), "run": self._run, "restarts": self._restarts, "warnings": self.warnings + self.problem.remarks(self.comm),
                      "seconds": self._seconds()}
            write_checkpoint(self.comm, directory, header, entries)

        return save

    def _computed(self):
        """Return {name: function that returns the field}, of fields that are found by an exchange."""
        return {} if self.fragments is None else {"fragment": self.fragments.labels}

    def _write(self, directory, record):
        on_root(self.comm, write_json, Path(directory) / "run.json", record)

    def _seconds(self):
        """Return {"mean": {phase: s}, "slowest": ...} over the ranks, what was there before a restart included. Collective."""
        phases = {**self.seconds, **self.stepper.seconds}
        every = np.array(self.comm.allgather(list(phases.values())), float)
        found = {"mean": dict(zip(phases, every.mean(axis=0).tolist())), "slowest": dict(zip(phases, every.max(axis=0).tolist()))}
        return {of: {name: value + self._earlier[of].get(name, 0.0) for name, value in values.items()} for of, values in found.items()}

    def _record(self, status):
        """Return the content of run.json. Collective."""
        problem, stepper, comm = self.problem, self.stepper, self.comm
        mean, slowest = self._seconds().values()
        return {
            "status": status,
            "run": self._run,
            "restarts": self._restarts,
            "title": self.scene.title,
            "scene_file": self.scene.source,
            "versions": versions(),
            "commit": self._commit,
            "petsc_options": list(self._petsc_options),
            "host": platform.node(),
            "hosts": self.hosts,
            "files": self.files,
            "ranks": comm.size,
            **problem.sizes(stepper, comm),
            "method": self.scene.method,
            "critical_dt": problem.critical_dt,
            "dt": problem.dt,
            "steps": stepper.step,
            "steps_planned": problem.n_steps,
            "time": stepper.time,
            "seconds": mean,
            "seconds_slowest_rank": slowest,
            **problem.work(stepper, comm, sum(mean[name] for name in stepper.seconds if name in _STEPPING)),
            "coupling": problem.coupled(stepper, comm, self.coupling),
            "broken_bonds": self.energies.latest.get("broken_bonds", 0),
            "energies": {name: value for name, value in self.energies.latest.items() if name != "broken_bonds"},
            "balance_error_relative": self.energies.relative_error() if self.energies.latest else None,
            "tips": {tip.settings.name: tip.record() for tip in self.tips},
            "fragments": None if self.fragments is None or status != "done" else self.fragments.find(stepper),
            "warnings": self.warnings,
            "scene": self.scene.resolved(),
        }


@contextlib.contextmanager
def _solver_errors():
    """Let a linear system that was not solved, which every rank hears of, end the run with its sentence."""
    try:
        yield
    except SolverError as error:
        raise RunError(str(error)) from error


class _Nowhere:
    """History of a run that writes nothing."""

    def begin(self):
        """Write nothing."""

    def append(self, row):
        """Drop the row."""


def read_on_root(path, overrides, comm):
    """Return the Scene of a file that rank 0 reads; a SceneError is raised on every rank. Collective."""
    text = on_root(comm, read_text, path)
    return parse_scene(text, str(path), overrides)


def _compile_first_on_each_node(comm, scene):
    """Let one rank of each node compile the kernels into the cache before the others load them; what fails there is raised on every rank. Collective."""
    from mpi4py import MPI

    if scene.uses_mesh or scene.method == "newton":
        start_petsc()
    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    with agree_on_error(comm):
        if node.rank == 0:
            from pdhpc.warm_up import compile_scene

            try:
                compile_scene(scene, MPI.COMM_SELF)
            except OSError as error:
                raise OutputError(f"{error.filename or 'the folder of compiled kernels'}: cannot be written ({error.strerror}); NUMBA_CACHE_DIR names another folder") from error
    node.Free()
