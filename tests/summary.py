"""Add up the junit reports of tools/test; fail when a part ran nothing or an MPI test ran on no number of ranks.

Usage: summary.py FOLDER NUMBER_OF_PYTEST_ARGUMENTS (with arguments, parts may select nothing).
"""
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

PARTS = ("serial", "mpi2", "mpi3", "mpi4")


def outcomes(path):
    """Return {test: "passed" | "failed" | "skipped"} of a junit file, or None when there is none."""
    if not path.exists():
        return None
    found = {}
    for case in ElementTree.parse(path).iter("testcase"):
        states = {child.tag for child in case}
        name = f"{case.get('classname')}::{case.get('name')}"
        found[name] = "failed" if states & {"failure", "error"} else "skipped" if "skipped" in states else "passed"
    return found


def main(folder, selected):
    """Print the summary and return the exit code."""
    reports = {part: outcomes(Path(folder) / f"{part}.xml") for part in PARTS}
    problems = [f"{part}: no report (crashed or timed out)" for part, report in reports.items() if report is None]
    reports = {part: report or {} for part, report in reports.items()}
    ran = {part: [name for name, state in report.items() if state != "skipped"] for part, report in reports.items()}
    if not selected:
        problems += [f"{part}: no test ran" for part, names in ran.items() if not names]
        known, seen = (set().union(*(lists[part] for part in PARTS[1:])) for lists in (reports, ran))
        problems += [f"{name}: ran on no number of ranks" for name in sorted(known - seen)]
    states = [state for report in reports.values() for state in report.values()]
    for problem in problems:
        print(f"tools/test: {problem}")
    failures = states.count("failed") + len(problems)
    print(f"{states.count('passed')} passed, {failures} failed")
    return 1 if failures or not states.count("passed") else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2])))
