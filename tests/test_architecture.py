"""The floors of the tree: each package imports only from packages of earlier floors.

A new package has to be put into `LAYERS`; if it is not clear where, the plan is wrong.
"""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from armloop.moved import present_name

SOURCE = Path(__file__).resolve().parents[1] / "src"

# A package may import itself and every package of an earlier floor.
LAYERS = (
    {"moved"},
    {"__init__"},
    {"util"},
    {"data", "regression", "schemas"},
    {"robot"},
    {"convert", "features", "laws"},
    {"experiment", "model"},
    {"dynamics", "monitoring"},
    {"drake", "identification"},
    {"diagnosis", "export"},
    {"watch"},
    {"reports"},
    {"workflows"},
    {"armloop_paper"},
    {"commands"},
    {"api"},
    {"cli"},
    {"__main__"},
)
RANK = {room: rank for rank, rooms in enumerate(LAYERS) for room in rooms}

# The floors inside a package; files beside its folders come before all of them if they are not named.
INSIDE = {
    "drake": ("plant", "control", "view", "experiments", "tuning"),
    "laws": ("effects",),
    "experiment": ("excitation", "design", "sampling"),
}

# What the order of the layers would allow and the plan does not.
FORBIDDEN = {
    "diagnosis": {"drake"},  # it sees arrays, never a simulator
    "identification": {"drake"},
}
# All that pure numerics (arrays in, arrays out) may know.
ONLY = {"regression": {"armloop.util.arrays", "armloop.util.errors", "armloop.util.registry"}}


def modules() -> dict[str, Path]:
    """Return every module of armloop and armloop_paper by its dotted name."""
    found = {}
    for path in sorted(SOURCE.rglob("*.py")):
        parts = path.relative_to(SOURCE).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()


def room(module: str) -> str:
    """Return the package that a module belongs to: `armloop`'s own, or all of the paper's."""
    if is_within(module, "armloop_paper"):
        return "armloop_paper"
    return module.split(".")[1] if "." in module else "__init__"


def floor(module: str, package: str) -> int:
    """Return the floor inside a package that a module belongs to; 0 for files beside the package's folders."""
    parts = module.split(".")
    return INSIDE[package].index(parts[2]) + 1 if len(parts) > 2 and parts[2] in INSIDE[package] else 0


@cache
def imports(module: str) -> tuple[str, ...]:
    """Return the dotted name of everything that a module imports, wherever in it the import stands."""
    return tuple(_imports(module))


def _imports(module: str) -> Iterator[str]:
    path = MODULES[module]
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            source = ".".join([*above, *([node.module] if node.module else [])])
            yield from (f"{source}.{name.name}" for name in node.names)


@cache
def own_imports(module: str) -> set[str]:
    """Return the modules of the package that a module imports."""
    found = set()
    for name in imports(module):
        while name.startswith("armloop") and name not in MODULES:
            name = name.rpartition(".")[0]
        if name in MODULES:
            found.add(name)
    return found - {module}


def is_within(module: str, package: str) -> bool:
    """Tell whether a dotted name is the package or lies in it."""
    return f"{module}.".startswith(f"{package}.")


@pytest.mark.parametrize("module", MODULES)
def test_imports_only_from_earlier_floors(module: str) -> None:
    here = room(module)
    assert here in RANK, f"{here}: a new package; put it into LAYERS"
    for other in sorted({room(name) for name in own_imports(module)} - {here}):
        assert other in RANK, f"{other}: a new package; put it into LAYERS"
        assert RANK[other] < RANK[here], f"{module} imports {other}, which does not come before {here}"
        assert other not in FORBIDDEN.get(here, set()), f"{module} must not import {other}"
    for name in own_imports(module):
        assert is_within(name, f"armloop.{here}") or name in ONLY.get(here, {name}), (
            f"{module} must not import {name}"
        )


@pytest.mark.parametrize("package", INSIDE)
def test_floors_inside_a_package_run_one_direction(package: str) -> None:
    folder = SOURCE / "armloop" / package
    assert {path.parent.name for path in folder.glob("*/__init__.py")} <= set(INSIDE[package])
    for module in MODULES:
        if is_within(module, f"armloop.{package}") and module != f"armloop.{package}":
            for name in own_imports(module):
                if is_within(name, f"armloop.{package}"):
                    assert floor(name, package) <= floor(module, package), f"{module} imports {name}"


def test_the_paper_is_known_to_its_command_alone() -> None:
    for module in MODULES:
        if is_within(module, "armloop") and module != "armloop.commands.reproduce":
            for name in imports(module):
                assert not is_within(name, "armloop_paper"), f"{module} imports {name}"


def test_a_number_of_the_diagnosis_is_stated_once() -> None:
    """Two modules that call a number the same and give it the same value state one idea twice."""
    stated: dict[tuple[str, str], str] = {}
    for module in (name for name in MODULES if is_within(name, "armloop.diagnosis")):
        for node in ast.parse(MODULES[module].read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.Assign):
                continue
            target, value = node.targets[0], node.value
            several = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
            pairs = zip(target.elts, value.elts, strict=True) if several else [(target, value)]
            for name, number in pairs:
                if isinstance(name, ast.Name) and isinstance(number, ast.Constant):
                    key = name.id.lstrip("_"), str(number.value)
                    assert stated.setdefault(key, module) == module, f"{module} and {stated[key]}: {key}"


FORMER = re.compile(r"(?<![\w.])armloop(?:\.\w+)+")
#: What tells or tests the former names.
TELLING = {"tests/test_moved.py", "src/armloop/moved.py", "docs/moved.md"}


def import_statements(tree: ast.AST) -> Iterator[ast.stmt]:
    """Wherever they stand; expressions, which hold none, are most of a tree, and are not looked at."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        elif isinstance(node, ast.stmt | ast.excepthandler | ast.match_case):
            yield from import_statements(node)


def test_nothing_here_uses_a_former_name() -> None:
    root = SOURCE.parent
    for path in [
        *SOURCE.rglob("*.py"),
        *(p for kind in ("tests", "benchmarks", "scenarios") for p in (root / kind).rglob("*.py")),
    ]:
        if str(path.relative_to(root)) not in TELLING:
            for node in import_statements(ast.parse(path.read_text(encoding="utf-8"))):
                names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
                if isinstance(node, ast.ImportFrom) and node.module and not node.level:
                    names = [node.module, *(f"{node.module}.{a.name}" for a in node.names)]
                for name in names:
                    assert present_name(name) is None, f"{path}: {name} is now {present_name(name)}"
    for page in [
        root / "README.md",
        root / "CONTRIBUTING.md",
        *(root / "docs").rglob("*.md"),
        *(root / "docs").rglob("*.py"),
    ]:
        if str(page.relative_to(root)) not in TELLING:
            for line in page.read_text(encoding="utf-8").splitlines():
                for name in [] if "entry-points" in line else FORMER.findall(line):
                    assert present_name(name) is None, f"{page}: {name} is now {present_name(name)}"


def test_no_modules_import_each_other() -> None:
    # a package's __init__ is its public face and imports its parts: they must not look at it
    done: set[str] = set()

    def follow(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, f"a circle of imports: {' -> '.join([*path, module])}"
        if module not in done:
            for other in sorted(own_imports(module)):
                follow(other, (*path, module))
            done.add(module)

    for module in MODULES:
        follow(module, ())


@pytest.mark.parametrize("module", MODULES)
def test_only_drake_imports_pydrake(module: str) -> None:
    allowed = ["pydrake"] if room(module) == "drake" else []
    if module == "armloop.robot.arm":  # reads URDFs with Drake's parser, builds no diagram
        allowed = ["pydrake.multibody", "pydrake.math", "pydrake.common"]
    if room(module) == "export":  # the consumers' parsers and a program's solvers, no diagram
        allowed = ["pydrake.multibody", "pydrake.solvers"]
    for name in imports(module):
        if is_within(name, "pydrake"):
            assert any(is_within(name, package) for package in allowed), f"{module} imports {name}"


def test_diagnosis_cannot_see_what_was_hidden_from_it() -> None:
    for module in MODULES:
        if room(module) == "diagnosis":
            for name in imports(module):
                assert "undeclared" not in name.lower(), f"{module} imports {name}"
                assert "demonstration" not in name.lower(), f"{module} imports {name}"


def loaded_by(statement: str) -> set[str]:
    """Return the top-level packages that are loaded after a statement, in an interpreter of its own."""
    program = f"{statement}; import sys; print(*sys.modules, sep='\\n')"
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return {name.partition(".")[0] for name in answer.stdout.split()}


def test_importing_the_package_is_cheap() -> None:
    assert not loaded_by("import armloop") & {"numpy", "pydrake", "matplotlib"}


@pytest.mark.skipif("armloop.cli" not in MODULES, reason="there is no command line yet")
def test_the_command_line_starts_without_drake() -> None:
    assert "pydrake" not in loaded_by("import armloop.cli")
