"""What the program prints: the summary of a run, what `pdhpc check` says of a scene, and the table of its keys."""
import math

from rich.console import Console
from rich.table import Table

_BODIES = 12  # that `check` lists


def print_summary(record, directory, pictures):
    """Print the table of a finished run and where its outputs are."""
    seconds = record["seconds"]
    rows = [
        ("scene", record["title"] or record["scene_file"]),
        ("ranks", str(record["ranks"])),
        *_body_rows(record),
        ("steps, dt", f"{record['steps']:,}, {record['dt']:.4g} s" + (f" (critical {record['critical_dt']:.4g} s)" if math.isfinite(record["critical_dt"]) else "")),
        ("wall time", "  ".join(f"{name} {value:.2f} s" for name, value in seconds.items())),
        *_speed_rows(record),
        ("broken bonds", f"{record['broken_bonds']:,}"),
        *((name.replace("_", " "), f"{value:.6g} J") for name, value in record["energies"].items()),
        ("balance error", f"{record['balance_error_relative'] or 0:.2e} of the largest energy"),
        *((f"tip {name}", _tip(tip)) for name, tip in record["tips"].items()),
        *_fragment_rows(record["fragments"]),
    ]
    print_rows(rows)
    for warning in record["warnings"]:
        print(f"warning: {warning}")
    print(f"output: {directory}")
    for picture in pictures:
        print(f"picture: {picture}")


def _body_rows(record):
    """Return the rows that say what the body is made of."""
    rows = []
    if "dofs" in record:
        rows.append(("cells, vertices, dofs", f"{record['cells']:,} ({record['cell_kind']}), {record['vertices']:,}, {record['dofs']:,}"))
        rows += _piece_rows(record.get("pieces", 1))
        rows.append(("integration, moduli", f"{record['integration']}, {record['moduli']}"))
    elif "cells" in record:
        found = record["coupling"]
        rows.append(("cells, vertices", f"{record['cells']:,}, {record['vertices']:,}; {found['patches']:,} patches at the end"))
        rows.append(("scheme, sub-steps", f"{found['scheme']}, {found['sub_steps']} of {found['particle_dt']:.4g} s"))
        rows.append(("active share", f"{found['active_share']:.1%} of the particles move by themselves at the end"))
    if "particles" in record:
        rows += [("path", record["path"]), ("particles, bonds", f"{record['particles']:,}, {record['bonds']:,}")]
    return rows


def _piece_rows(count):
    """Return the row that says that a mesh does not hang together."""
    return [("pieces", f"{count:,} that share no facet with each other")] if count > 1 else []


def _speed_rows(record):
    """Return the rows that say how fast it went."""
    rows = []
    for name in ("particle", "cell"):
        if f"{name}_steps_per_second_and_core" in record:
            rate = record[f"{name}_steps_per_second_and_core"]
            rows.append(("speed", "-" if rate is None else f"{rate / 1e6:.3f} million {name}-steps per second and core"))
    if "equilibrium" in record:
        found = record["equilibrium"]
        ksp = f" ({found['ksp_iterations']:,} of the KSP)" if found["ksp_iterations"] else ""
        rows.append(("equilibria", f"{found['equilibria']:,} by {record['method']} in {found['iterations']:,} iterations{ksp}, residual at most {found['largest_residual']:.2g}"
                                   f" of {found['reference_force']:.4g} N at the end of a load step"))
    if record.get("ksp_iterations"):
        rows.append(("KSP iterations", f"{record['ksp_iterations']:,}"))
    return rows


def _fragment_rows(found):
    """Return the row that says how many fragments there are, if they were counted."""
    return [] if found is None else [("fragments", f"{found['count']:,}, the heaviest {found['largest']:.1%} of the mass, dust {found['dust']:.1%}")]


def _tip(tip):
    if tip["position"] is None:
        return "none"
    place, path = (None if vector is None else "(" + ", ".join(f"{x:.5g}" for x in vector) + ")" for vector in (tip["position"], tip["path_direction"]))
    return f"at {place} m, fastest {tip['largest_speed']:.0f} m/s" + ("" if path is None else f", on a path along {path}")


def print_rows(rows, title=None):
    """Print two columns."""
    table = Table(show_header=False, box=None, title=title, title_justify="left", padding=(0, 2, 0, 0))
    for name, value in rows:
        table.add_row(name, value)
    _console().print(table)


def print_explanation(rows):
    """Print every key of a scene: value, given or default, unit, meaning and source."""
    table = Table("key", "value", "", "unit", "meaning", "source", box=None, padding=(0, 1, 0, 0))
    for row in rows:
        table.add_row(*(str(cell).replace("[", r"\[") for cell in row))
    _console().print(table)


def _console():
    """Return a console as wide as the terminal, or wide enough for a line per row in a file."""
    console = Console()
    return console if console.is_terminal else Console(width=240)


def print_check(scene, ranks):
    """Print what a scene would do: particles and bonds, or cells and vertices, steps, memory, time."""
    if scene.model == "fem":
        return _print_mesh_check(scene, ranks)
    if scene.model == "gfem":
        return _print_coupled_check(scene, ranks)
    from pdhpc.study.estimate import estimate

    found = estimate(scene, ranks)
    about = "" if found.exact else "about "
    print_rows([
        ("scene", scene.title or scene.source),
        ("particles", f"{found.particles:,}"),
        *_amount_rows(found.bodies),
        ("path", found.path),
        ("bonds", f"{about}{found.bonds:,} (at most {found.neighbours} neighbours)"),
        *(("critical stretch", f"{material}: {text}") for material, text in found.critical_stretch),
        *(_load_rows(scene, found) if scene.stands_still else _step_rows(found)),
        ("ranks", str(found.ranks)),
        ("memory per rank", f"about {_size(found.memory)}"),
        ("estimated time", f"about {_duration(found.seconds)} (kernels at {found.rate / 1e6:.0f} million bonds per second and core, measured now)"),
    ])
    for warning in found.warnings:
        print(f"warning: {warning}")


def _amount_rows(bodies):
    """Return rows that say what bodies hold, and what was drawn, of the first of many."""
    rows = []
    for each in bodies[:_BODIES]:
        drawn = "" if each.drawn_volume is None else f"; drawn {each.drawn_volume:.6g} m^3"
        rows.append((f"body {each.name}", f"{each.particles:,} particles, {each.volume:.6g} m^3, {each.mass:.6g} kg{drawn}"))
    return rows + ([("", f"and {len(bodies) - _BODIES} bodies more")] if len(bodies) > _BODIES else [])


def _step_rows(found):
    """Return what `check` says of time steps."""
    return [
        ("critical step", f"{found.critical_dt:.6g} s (sqrt(2 rho / |A|), A the stiffness tensor of a particle's bonds{' and contact' if found.contact else ''}: a lower bound)"),
        *found.contact,
        *_region_rows(found),
        ("step" if not found.regions else "macro step", f"{found.dt:.6g} s"),
        ("steps", f"{found.steps:,}"),
    ]


def _load_rows(scene, found):
    """Return what `check` says of load steps."""
    return [
        ("method", f"{scene.method}, no critical step"),
        ("load steps", f"{found.steps:,} of {found.dt:.6g} s"),
        ("evaluations of forces", f"about {found.evaluations:,} in each equilibrium, if the body's slowest motion is a stretch of its longest side (bending takes more), and as "
                                  "many again whenever bonds break"),
    ]


def _print_mesh_check(scene, ranks):
    """Print what a scene of finite elements would do."""
    from pdhpc.study.mesh_estimate import estimate_mesh

    found = estimate_mesh(scene, ranks)
    about = "" if found.exact else "about "
    critical = f"{found.critical_dt:.6g} s (2 / omega_max of the lumped mesh, from below)" if math.isfinite(found.critical_dt) else "none: stable at any step"
    print_rows([
        ("scene", scene.title or scene.source),
        ("cells", f"{found.cells:,} ({found.kind})"),
        *_piece_rows(found.pieces or 1),
        ("vertices, dofs", f"{about}{found.vertices:,}, {found.dofs:,}"),
        ("integration, moduli", f"{found.integration}, {found.moduli}"),
        ("critical step", critical),
        ("step", f"{found.dt:.6g} s"),
        ("steps", f"{found.steps:,}"),
        ("ranks", str(found.ranks)),
        ("memory per rank", f"about {_size(found.memory)}"),
        ("estimated time", f"about {_duration(found.seconds)} (a step at {found.rate / 1e6:.3g} million cells per second and core, measured now)"),
    ])
    for warning in found.warnings:
        print(f"warning: {warning}")


def _print_coupled_check(scene, ranks):
    """Print what a scene of finite elements enriched by particles would do."""
    from pdhpc.study.coupled_estimate import estimate_coupled

    found = estimate_coupled(scene, ranks)
    about = "" if found.exact else "about "
    print_rows([
        ("scene", scene.title or scene.source),
        ("cells, vertices", f"{about}{found.cells:,}, {about}{found.vertices:,}"),
        ("lattice", f"{found.particles:,} particles, {found.ratio} to the side of a cell"),
        *(("critical stretch", f"{material}: {text}") for material, text in found.critical_stretch),
        ("scheme, moduli", f"{scene.gfem.scheme}, {scene.moduli}"),
        ("patches at the start", f"{about}{found.patches:,} vertices, {about}{found.active:,} particles move by themselves ({found.active / max(found.particles, 1):.1%})"),
        ("critical step", f"{found.critical_dt:.6g} s (2 / omega_max of the lumped mesh, by Lanczos, times sqrt(5 h/H) where H > 5 h; 0.8 of it at most)"),
        ("step", f"{found.dt:.6g} s ({found.dt / found.critical_dt:.3f} of the critical one), {found.sub_steps} sub-steps of the particles"),
        ("sub-step", f"{found.dt / found.sub_steps:.6g} s (critical {found.particle_critical_dt:.6g} s: sqrt(2 rho / |A|), a lower bound)"),
        ("steps", f"{found.steps:,}"),
        ("ranks", str(found.ranks)),
        ("memory per rank", f"about {_size(found.memory)}"),
        ("estimated time", f"about {_duration(found.seconds)} if no patch were added"),
    ])
    for warning in found.warnings:
        print(f"warning: {warning}")


def _region_rows(found):
    """Return what `check` says of regions with a step of their own."""
    rows = []
    for region in found.regions:
        first, last = region.ranks
        ranks = f"rank {first}" if first == last else f"ranks {first} to {last}"
        rows.append((f"{region.name} region", f"{region.particles:,} particles, {region.share:.1%} of the work, step {region.dt:.4g} s, critical {region.critical_dt:.4g} s"
                     f" ({region.critical_dt / found.undivided_dt:.3f} of the undivided body's), {ranks}"))
    if rows:
        rows.append(("overlap", f"{found.overlap:,} particles in both regions; {found.step_ratio} fine steps in a macro step"))
    return rows


def _size(number):
    for unit in ("B", "kB", "MB", "GB"):
        if number < 1000:
            return f"{number:.3g} {unit}"
        number /= 1000
    return f"{number:.3g} TB"


def _duration(seconds):
    if not math.isfinite(seconds):
        return "unknown"
    if seconds < 120:
        return f"{seconds:.1f} s"
    return f"{seconds / 60:.1f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
