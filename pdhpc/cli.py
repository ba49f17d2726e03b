"""Command line: words in, calls out. Heavy imports happen inside the subcommands, so that --help is quick."""
import argparse
import sys

EXIT_FAILED, EXIT_BAD_INPUT, EXIT_STOPPED = 1, 2, 3


def main(arguments=None):
    """Run one subcommand and exit with its code: 0 done, 1 failed in the run, 2 bad input, 3 stopped on request, the state saved."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    words, petsc_options = _split_petsc_options(words)
    options = _parser().parse_args(words)
    options.petsc_options = petsc_options
    try:
        sys.exit(_report_errors(options))
    except KeyboardInterrupt:
        _die_of_interrupt()


def _die_of_interrupt():
    """End as SIGINT ends programs that do not listen to it, of which shells and mpirun know, and without a traceback of each rank."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.raise_signal(signal.SIGINT)


def _split_petsc_options(words):
    """Return (words before "--", words after it)."""
    if "--" not in words:
        return words, []
    at = words.index("--")
    return words[:at], words[at + 1 :]


def _parser():
    parser = argparse.ArgumentParser(prog="pdhpc", description="Fracture by peridynamics on parallel machines.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="run a scene (alone or under mpirun/srun)", epilog="Options after -- go to PETSc.")
    run.add_argument("scene", metavar="SCENE")
    run.add_argument("-o", "--output", metavar="DIR", required=True, help="folder for run.json, fields.h5, history.csv and pictures")
    run.add_argument("--overwrite", action="store_true", help="replace the run that DIR holds")
    _add_talk(run)
    _add_set(run)
    run.set_defaults(action=_run)
    restart = commands.add_parser("restart", help="go on with a run from its last checkpoint, on any number of ranks", epilog="Options after -- go to PETSc, in the place of those of the run.")
    restart.add_argument("directory", metavar="DIR")
    _add_talk(restart)
    restart.add_argument("--set", action="append", default=[], metavar="section.key=value", dest="overrides",
                         help="change time.end, or keys of output and checkpoint; may be repeated")
    restart.set_defaults(action=_restart)
    check = commands.add_parser("check", help="say what a scene would do, without running it")
    check.add_argument("scene", metavar="SCENE", nargs="?")
    check.add_argument("--explain", action="store_true", help="print every key: value, given, default or absent, unit, meaning, source; without a scene all that scenes know")
    check.add_argument("--schema", action="store_true", help="print the JSON schema of scenes, for editors")
    check.add_argument("--ranks", type=int, default=None, metavar="N", help="number of ranks to estimate for (default: this job's)")
    _add_set(check)
    check.set_defaults(action=_check)
    view = commands.add_parser("view", help="draw pictures of a run")
    view.add_argument("directory", metavar="DIR")
    view.add_argument("--frame", type=int, default=-1, metavar="K", help="the K-th frame, from 0; -1 is the last (default)")
    view.add_argument("--from", default=None, metavar="AZ,EL", dest="direction", help="3D: where the camera stands, degrees from x towards y, and above (default -60,30)")
    view.add_argument("--cut", default=None, metavar="x=PLACE", help="3D: plane of the cut, m, of x, y or z (default the middle of the body)")
    view.add_argument("--above", type=float, default=None, metavar="DAMAGE", help="3D: least damage of what is drawn alone (default 0.35)")
    view.set_defaults(action=_view)
    verify = commands.add_parser("verify", help="run the named checks of the physics on this machine")
    verify.add_argument("names", metavar="NAME", nargs="*")
    verify.add_argument("--list", action="store_true", help="list the checks and what they hold")
    verify.set_defaults(action=_verify)
    scale = commands.add_parser("scale", help="measure how a scene scales: one launch for each number of ranks")
    scale.add_argument("study", metavar="STUDY")
    scale.add_argument("-o", "--output", metavar="DIR", required=True, help="folder for scaling.csv, pictures and a file for each launch")
    scale.add_argument("--point", type=int, default=None, metavar="K", help="only the K-th number of ranks, from 0 (for job arrays)")
    scale.add_argument("--overwrite", action="store_true", help="run again what DIR holds already")
    scale.add_argument("--predict", default=None, metavar="MACHINE", help="predict other machines from the runs on 1 and 2 ranks: a preset or a TOML file")
    scale.add_argument("--set", action="append", default=[], metavar="key=value", dest="overrides", help="change a key of the study; may be repeated")
    scale.set_defaults(action=_scale)
    chart = commands.add_parser("chart", help="speed against accuracy: a scene with a fine region by every method and step ratio", epilog="Options after -- go to PETSc.")
    chart.add_argument("scene", metavar="SCENE")
    chart.add_argument("-o", "--output", metavar="DIR", required=True, help="folder for chart.csv and chart.png")
    chart.add_argument("--ratios", default="1,2,4,5,10,20", metavar="M,M,...", help="step ratios (default 1,2,4,5,10,20)")
    chart.add_argument("--methods", default="", metavar="NAME,...", help="of single, polynomial, exact, kick, subcycling, micro (default all)")
    _add_set(chart)
    chart.set_defaults(action=_chart)
    return parser


def _add_talk(parser):
    talk = parser.add_mutually_exclusive_group()
    talk.add_argument("--quiet", action="store_true", help="no progress, no table")
    talk.add_argument("--verbose", action="store_true", help="the lines of the log, DIR/run.log, as they come")


def _add_set(parser):
    parser.add_argument("--set", action="append", default=[], metavar="section.key=value", dest="overrides", help="change a key of the scene; may be repeated")


def _report_errors(options):
    """Return the exit code of a subcommand; an expected error becomes one sentence on rank 0."""
    from pdhpc.run import RunError, StopRequested
    from pdhpc.output.record import OutputError
    from pdhpc.parallel.linear_solver import OptionError
    from pdhpc.scene.read import SceneError

    try:
        return options.action(options)
    except (SceneError, OptionError) as error:
        return _say(error, EXIT_BAD_INPUT)
    except OutputError as error:
        return _say(error, getattr(error, "exit_code", EXIT_FAILED))
    except RunError as error:
        return _say(error, EXIT_FAILED)
    except StopRequested as stop:
        return _say(stop, EXIT_STOPPED)


def _say(error, code):
    """Print an error once, whatever the number of ranks, and return the exit code."""
    if _is_root():
        print(f"pdhpc: {error}", file=sys.stderr, flush=True)
    return code


def _is_root():
    """Whether this process prints: rank 0, or the only one. MPI is asked only when it is running."""
    mpi = sys.modules.get("mpi4py.MPI")
    return mpi is None or mpi.COMM_WORLD.rank == 0


def _ignore_requests():
    """Let SIGUSR1 do nothing where there is no state to save, before the first step and after the last: unheard it would end the job."""
    import signal

    signal.signal(signal.SIGUSR1, signal.SIG_IGN)


def _run(options):
    from pdhpc.output.record import check_directory
    from pdhpc.parallel.comm import on_root, world
    from pdhpc.parallel.linear_solver import use_options
    from pdhpc.simulation import Simulation, read_on_root

    _ignore_requests()
    comm = world()
    scene = read_on_root(options.scene, options.overrides, comm)
    on_root(comm, check_directory, options.output, options.overwrite)
    use_options(options.petsc_options)
    _show_log(options, comm)
    simulation = Simulation(scene, comm, options.petsc_options)
    record = simulation.run(options.output, options.overwrite, options.quiet or options.verbose)
    if comm.rank == 0:
        _finish_on_root(scene, record, options.output, options.quiet)
    return 0


def _restart(options):
    from pdhpc.parallel.comm import on_root, world
    from pdhpc.parallel.linear_solver import use_options
    from pdhpc.restart import find, scene_of
    from pdhpc.simulation import Simulation

    _ignore_requests()
    comm = world()
    saved = on_root(comm, find, options.directory)
    scene = scene_of(saved[0], options.directory, options.overrides)
    petsc_options = options.petsc_options or saved[0].header.get("petsc_options", [])
    use_options(petsc_options)
    _show_log(options, comm)
    simulation = Simulation(scene, comm, petsc_options)
    record = simulation.resume(options.directory, saved, options.quiet or options.verbose)
    if comm.rank == 0:
        _finish_on_root(scene, record, options.directory, options.quiet)
    return 0


def _show_log(options, comm):
    """Print lines of the log on rank 0 of a verbose run."""
    if options.verbose and comm.rank == 0:
        from pdhpc.output.log import show_log

        show_log()


def _finish_on_root(scene, record, directory, quiet):
    """Draw the pictures and print the summary."""
    from pdhpc.report import print_summary

    pictures = _draw(directory, scene) if scene.output.pictures else []
    if not quiet:
        print_summary(record, directory, pictures)


def _draw(directory, scene, **view):
    from pdhpc.output.fracture_picture import View
    from pdhpc.output.picture import draw

    return draw(directory, _curve_columns(scene, directory), View(**view))


def _curve_columns(scene, directory):
    """Return [(name, x column, y column)] of the scene's curves as history.csv names them."""
    from pathlib import Path

    with open(Path(directory) / "history.csv") as file:
        columns = file.readline().strip().split(",")
    full = {column.split(" [")[0]: column for column in columns}
    return [(curve.name, full[curve.x], full[curve.y]) for curve in scene.curve]


def _check(options):
    from pdhpc.scene import explain

    if options.schema:
        import json

        print(json.dumps(explain.json_schema(), indent=2))
        return 0
    from pdhpc import report
    from pdhpc.scene.read import SceneError, read_scene

    if options.scene is None:
        if options.explain and not options.overrides:
            report.print_explanation(explain.explain_all())
            return 0
        raise SceneError("pdhpc check: no scene given; allowed is a scene file (or --explain or --schema alone)")

    if options.ranks is not None and options.ranks < 1:
        raise SceneError(f"pdhpc check: --ranks = {options.ranks}; allowed is a whole number of at least 1")
    scene = read_scene(options.scene, options.overrides)
    if options.explain:
        report.print_explanation(explain.explain(scene))
    report.print_check(scene, options.ranks)
    return 0


def _view(options):
    from pathlib import Path

    from pdhpc.parallel.comm import world

    if world().rank > 0:  # one draws
        return 0
    from pdhpc.output.record import refusal, unreadable

    record = Path(options.directory) / "run.json"
    if not record.is_file():
        raise refusal(f"{options.directory}: no run.json found; allowed is the output folder of a run")
    import json

    from pdhpc.scene.read import scene_from_dict
    from pdhpc.scene.schema import SceneError

    with unreadable(lambda why: refusal(f"{options.directory}: its files cannot be read ({why}); allowed is the folder of a run as it was left"), SceneError):
        scene = scene_from_dict(json.loads(record.read_text(encoding="utf-8"))["scene"], str(record))
        pictures = _draw(options.directory, scene, **_view_of(options, scene))
    for path in pictures:
        print(path)
    return 0


def _view_of(options, scene):
    """Return the fields of a View that the options name. Raises SceneError."""
    from pathlib import Path

    from pdhpc.output.fields import frame_times
    from pdhpc.scene.read import SceneError

    def refuse(option, found, allowed):
        return SceneError(f"pdhpc view: {option} = {found}; allowed is {allowed}")

    count = len(frame_times(options.directory)) if (Path(options.directory) / "fields.h5").exists() else 0
    if count and not -count <= options.frame < count:
        raise refuse("--frame", options.frame, f"0 to {count - 1}, the frames of this run, or -1 for the last")
    view = {"frame": options.frame}
    for option, found in (("--from", options.direction), ("--cut", options.cut), ("--above", options.above)):
        if found is not None and scene.dim == 2:
            raise refuse(option, found, "no such option for a body in two dimensions")
    if options.direction is not None:
        try:
            view["azimuth"], view["elevation"] = (float(word) for word in options.direction.split(","))
        except ValueError:
            raise refuse("--from", f'"{options.direction}"', "two angles in degrees with a comma between, such as -60,30") from None
    if options.cut is not None:
        axis, _, place = options.cut.partition("=")
        try:
            view["cut"] = "xyz".index(axis.strip() or "?"), float(place)
        except ValueError:
            raise refuse("--cut", f'"{options.cut}"', "an axis and a place in m, such as x=0.01") from None
        if count:
            _check_cut(options, refuse, *view["cut"])
    if options.above is not None:
        if not 0.0 < options.above <= 1.0:
            raise refuse("--above", options.above, "a damage above 0 and up to 1")
        view["above"] = options.above
    return view


def _check_cut(options, refuse, axis, place):
    """Raise what `refuse` makes of a plane that does not cut the unloaded body."""
    from pdhpc.output.pixels import Body

    body = Body(options.directory)
    lower, upper = body.lower[axis], body.upper[axis]
    if not lower <= place <= upper:
        raise refuse("--cut", f'"{options.cut}"', f"a place in the body, {lower:.6g} to {upper:.6g} m along {'xyz'[axis]}")


def _scale(options):
    from pdhpc.study.scaling import run_study
    from pdhpc.study.scaling_report import report

    machine = None
    if options.predict is not None:
        from pathlib import Path

        from pdhpc.study.predictor import check_predictable, read_machine
        from pdhpc.study.scaling import read_study, scene_of_point

        machine = read_machine(options.predict)  # before anything runs
        check_predictable(scene_of_point(read_study(options.study, options.overrides), Path(options.study).parent, 1))
    study, rows = run_study(options.study, options.output, options.overrides, options.point, options.overwrite)
    pictures = report(study, rows, options.output)
    if machine is not None:
        from pdhpc.scene.body import radius_of
        from pdhpc.study.scaling_report import report_prediction

        scene = scene_of_point(study, Path(options.study).parent, 1)
        pictures.append(report_prediction(study, rows, scene.dim, radius_of(scene) / scene.particles.spacing, options.predict, options.output))
    for picture in pictures:
        print(f"picture: {picture}")
    print(f"rows: {options.output}/scaling.csv")
    return 0


def _chart(options):
    from pdhpc.parallel.comm import world
    from pdhpc.scene.schema import SceneError
    from pdhpc.parallel.linear_solver import use_options
    from pdhpc.study.chart import METHODS, chart, report

    try:
        ratios = sorted({int(word) for word in options.ratios.split(",")})
    except ValueError:
        ratios = [0]
    if not all(1 <= m <= 1000 for m in ratios):
        raise SceneError(f'pdhpc chart: --ratios = "{options.ratios}"; allowed is whole numbers from 1 to 1000 with commas between, such as 1,2,4')
    methods = options.methods.split(",") if options.methods else list(METHODS)
    for name in methods:
        if name not in METHODS:
            raise SceneError(f'pdhpc chart: --methods = "{name}"; allowed is {", ".join(METHODS)}')
    use_options(options.petsc_options)
    points = chart(options.scene, options.overrides, ratios, methods, options.output)
    if world().rank == 0:
        print(f"picture: {report(points, options.output)}\nrows: {options.output}/chart.csv")
    return 0


def _verify(options):
    from pdhpc.study.verify import catalogue

    return catalogue.main(options.names, options.list)
