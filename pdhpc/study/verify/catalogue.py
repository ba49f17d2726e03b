"""All verification cases, and the table that `pdhpc verify` prints."""
import difflib
import time

from pdhpc.parallel.comm import world
from pdhpc.scene.schema import SceneError
from pdhpc.study.verify import (  # noqa: F401  (they register their cases)
    bars, bodies, branching, contact, dynamics, elasticity, fem, fem_dynamics, fem_flat_top, fem_scenes, fracture, fragmentation, gfem, gfem_fracture, gfem_poster, hole,
    kalthoff, laws, mls, mts, mts_plate, petaling, shipped, state_based, static,
)
from pdhpc.study.verify.case import CASES


def main(names, only_list):
    """Run the named cases (all without names) and print their verdicts; return the exit code: 1 when a check fails.

    Cases of coupled regions and of coupled methods, and mls_ranks, run on all ranks together, the others on each rank alone; rank 0 prints. Collective.
    """
    from rich.console import Console
    from rich.table import Table

    console = Console(quiet=world().rank > 0)
    console = console if console.is_terminal or world().rank > 0 else Console(width=200)
    chosen = _choose(names)
    if only_list:
        for each in chosen:
            console.out(f"{each.name:26s} {each.meaning}", highlight=False)
        return 0
    table = Table("case", "check", "measured", "expected", "tolerance", "source", "verdict", box=None, padding=(0, 1, 0, 0))
    failed = total = 0
    for each in chosen:
        started = time.perf_counter()
        for check in each.function():
            total, failed = total + 1, failed + (not check.passed)
            tolerance = f"{check.tolerance:g}" + (" rel" if check.relative and check.expected != 0 and check.tolerance else "")
            verdict = "[green]pass[/]" if check.passed else "[bold red]FAIL[/]"
            table.add_row(each.name, check.what.replace("[", r"\["), f"{check.measured:.12g}", f"{check.expected:.12g}", tolerance, check.source, verdict)
        if console.is_terminal:
            console.print(f"{each.name}: {time.perf_counter() - started:.1f} s")
    console.print(table)
    console.print(f"{total - failed} of {total} checks passed")
    return 1 if failed else 0


def _choose(names):
    """Return the cases of the given names, or of groups (what stands before the first _ of a name); a SceneError names the nearest valid one."""
    groups = {}
    for name in CASES:
        groups.setdefault(name.split("_")[0], []).append(name)
    for name in names:
        if name not in CASES and name not in groups:
            near = difflib.get_close_matches(name, CASES, n=1, cutoff=0.4)
            hint = f' (did you mean "{near[0]}"?)' if near else ""
            raise SceneError(f"pdhpc verify: {name} is no check; allowed is {', '.join(CASES)}{hint}")
    chosen = [each for name in names for each in ([name] if name in CASES else groups[name])]
    return [CASES[name] for name in dict.fromkeys(chosen) or CASES]
