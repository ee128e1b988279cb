"""Examples in docstrings run, and every public function has one."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
from typing import TYPE_CHECKING

import pytest

import pendmap

if TYPE_CHECKING:
    from pathlib import Path

MODULES = ["pendmap"] + [
    module.name
    for module in pkgutil.walk_packages(pendmap.__path__, "pendmap.")
    if not module.name.endswith(("__main__", "_core"))
]
FUNCTIONS = [name for name in pendmap.__all__ if inspect.isfunction(getattr(pendmap, name))]


def examples(name: str) -> list[doctest.DocTest]:
    """Return the examples of one module."""
    return [
        test
        for test in doctest.DocTestFinder().find(importlib.import_module(name))
        if test.examples
    ]


@pytest.mark.parametrize("name", MODULES)
def test_examples_print_the_stated_output(
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    for test in examples(name):
        runner.run(test)
    assert not runner.failures


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_public_function_has_an_example(name: str) -> None:
    assert ">>> " in (getattr(pendmap, name).__doc__ or "")
