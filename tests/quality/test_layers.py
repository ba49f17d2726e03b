"""The house: imports go down only, MPI and PETSc stay where they belong, every module has its test."""
import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "pdhpc"

LAYERS = [  # from the ground up; what stands in one set must not import from another member of it
    {"__init__"},
    {"jit", "state"},
    {"parallel"},
    {"materials", "geometry", "conditions", "output"},
    {"kernels"},
    {"mls"},  # asks the bonds of both storages what a point sees, by kernels/family.py
    {"peridynamics", "fem"},
    {"mts"},
    {"gfem"},
    {"run"},
    {"observers"},
    {"scene"},
    {"warm_up", "provenance"},
    {"restart"},
    {"simulation"},
    {"study"},
    {"report"},
    {"cli"},
    {"__main__"},
]
MAY_IMPORT_MPI = {"parallel", "fem", "output", "run", "cli", "provenance", "simulation", "study"}
MODULES = sorted(PACKAGE.rglob("*.py"))


def part_of(path):
    """The folder below pdhpc that a module stands in, or its own name."""
    relative = path.relative_to(PACKAGE)
    return relative.parts[0] if len(relative.parts) > 1 else relative.stem


def level(part):
    return next(number for number, layer in enumerate(LAYERS) if part in layer)


def imports(path):
    """Yield the full names of all modules that a file imports, inside functions too."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def parts_imported(path):
    found = set()
    for name in imports(path):
        words = name.split(".")
        if words[0] == "pdhpc" and len(words) > 1:
            found.add(words[1] if words[1] != "__version__" else "__init__")
    return found - {part_of(path)}


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_imports_go_down(path):
    mine = level(part_of(path))
    upward = {part for part in parts_imported(path) if level(part) >= mine}
    assert not upward, f"{path.name} imports {upward}, which does not stand below it"


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_mpi_only_where_it_belongs(path):
    uses = {name.split(".")[0] for name in imports(path)} & {"mpi4py", "petsc4py"}
    assert not uses or part_of(path) in MAY_IMPORT_MPI, f"{path.name} imports {uses}"


def test_the_check_sees_an_upward_import(tmp_path):
    bad = PACKAGE / "kernels" / "imaginary.py"
    names = {name for name in imports_of_text("from pdhpc.scene.read import read_scene")}
    assert level("scene") > level(part_of(bad)) and "pdhpc.scene.read" in names


def imports_of_text(text):
    return {node.module for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)}


TESTED_HERE = [path for path in MODULES if path.name not in ("__init__.py", "__main__.py") and "verify" not in path.parts]  # those: tests/physics


@pytest.mark.parametrize("path", TESTED_HERE, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_every_module_has_its_test(path):
    relative = path.relative_to(PACKAGE)
    twin = ROOT / "tests" / "unit" / relative.parent / f"test_{relative.name}"
    assert twin.exists(), f"{relative} has no {twin.relative_to(ROOT)}"


def without_docstring(path, node):
    """Names of public classes, functions and methods without a docstring; functions inside functions are nobody's interface."""
    bare = []
    for child in node.body:
        if isinstance(child, (ast.FunctionDef, ast.ClassDef)) and not child.name.startswith("_"):
            if not ast.get_docstring(child):
                bare.append(f"{path.relative_to(PACKAGE)}:{child.lineno} {child.name}")
            if isinstance(child, ast.ClassDef):
                bare += without_docstring(path, child)
    return bare


def test_public_functions_have_docstrings():
    bare = [name for path in MODULES for name in without_docstring(path, ast.parse(path.read_text()))]
    assert not bare, bare
    assert len(MODULES) > 40, "the walk found the package"
