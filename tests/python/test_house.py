"""Layout of the package: sizes, directions of imports, names and locations.

A change may lower the limits marked as ratchets, never raise them.
"""

from __future__ import annotations

import ast
import functools
import re
from pathlib import Path

import click
import pytest

import pendmap
from pendmap.cli.main import command

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "python" / "pendmap"
MODULES = sorted(PACKAGE.rglob("*.py"))

LINES = 40_445
"""Ratchet: lines of Python in python/pendmap, in thousands: a small addition changes no limit."""
DIRECT = 370
"""Ratchet: format specifications of numbers outside formatting.py."""
INTERNAL = 108
"""Ratchet: modules inside packages that tests import."""


@functools.cache
def tree(path: Path) -> ast.Module:
    """Return the syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def name_of(path: Path) -> str:
    """Return the dotted name of a module."""
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(path: Path) -> set[str]:
    """Return the modules of the package imported anywhere in a file, type checking included."""
    known = {name_of(module) for module in MODULES}
    found = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("pendmap"):
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                found.add(full if full in known else node.module)
    return found


def test_six_files_stand_at_the_root() -> None:
    names = {path.stem for path in PACKAGE.glob("*.py")}
    assert names <= {"__init__", "__main__", "errors", "files", "formatting", "units"}


def test_packages_and_files_are_small() -> None:
    folders = {path.parent for path in MODULES}
    assert not [folder.name for folder in folders if len(list(folder.glob("*.py"))) > 30]
    sizes = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in MODULES}
    assert not {str(path.relative_to(PACKAGE)): n for path, n in sizes.items() if n > 450}
    assert sum(sizes.values()) <= LINES
    mark = "fmt: " + "skip"  # a line that escapes the formatter
    assert not [str(path) for path in MODULES if mark in path.read_text(encoding="utf-8")]


def test_no_module_imports_itself_through_others() -> None:
    edges = {name_of(path): imported(path) - {"pendmap"} for path in MODULES}
    done: set[str] = set()

    def visit(module: str, way: list[str]) -> None:
        assert module not in way, " -> ".join([*way, module])
        if module not in done:
            for other in sorted(edges.get(module, set()) - {module}):
                visit(other, [*way, module])
            done.add(module)

    for module in edges:
        visit(module, [])


def test_only_fronts_list_their_exports() -> None:
    listed = {
        path
        for path in MODULES
        for node in tree(path).body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
    }
    assert not [str(path) for path in listed if path.name != "__init__.py"]


@pytest.mark.parametrize("name", command.list_commands(click.Context(command)))
def test_a_command_is_an_analysis_or_a_module_of_its_name(name: str) -> None:
    analysis = name in {command for command, *_ in pendmap.ANALYSES.values()}
    assert analysis != (PACKAGE / "cli" / f"{name}.py").exists()


def test_numbers_become_text_in_one_place() -> None:
    spec = re.compile(r"\{[^{}]*:[+-]?\.?\d*\.\d*[gfe]\}")
    texts = {p: p.read_text(encoding="utf-8") for p in MODULES if p.name != "formatting.py"}
    assert sum(len(spec.findall(text)) for text in texts.values()) <= DIRECT


def test_tests_import_the_fronts_of_packages() -> None:
    fronts = {name_of(path) for path in MODULES if path.name == "__init__.py"}
    tests = sorted((ROOT / "tests" / "python").rglob("*.py"))
    known = {module for path in tests for module in imported(path)} - fronts
    inner = {module for module in known if module.count(".") > 1}
    assert len(inner) <= INTERNAL, sorted(inner)
