"""What is published: version, extras, links; examples in docstrings."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
import re
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

import pendmap
from pendmap import _core

ROOT = Path(__file__).resolve().parents[2]


def parsed(name: str) -> dict[str, Any]:
    return tomllib.loads((ROOT / name).read_text(encoding="utf-8"))


PROJECT = parsed("pyproject.toml")["project"]
EXTRAS: dict[str, list[str]] = PROJECT["optional-dependencies"]


def test_one_version_and_one_repository_stand_everywhere() -> None:
    cargo = parsed("Cargo.toml")["workspace"]["package"]
    version, repository = cargo["version"], cargo["repository"]
    assert pendmap.__version__ == _core.__version__ == version
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {version}\n" in citation
    assert f"repository-code: {repository}\n" in citation
    assert f"\n## {version} - " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert all(link.startswith(repository) for link in PROJECT["urls"].values())


def test_the_heavy_packages_are_extras() -> None:
    found = {re.split(r"[\[>=<]", each)[0] for each in PROJECT["dependencies"]}
    assert not found & {"rerun-sdk", "pyarrow", "zarr", "fsspec", "distributed", "openpyxl"}
    installed = metadata.metadata("pendmap").get_all("Provides-Extra") or []
    assert set(installed) == set(EXTRAS)


def test_all_has_every_extra_for_users_and_dev_what_tests_use() -> None:
    (every,) = EXTRAS["all"]
    named = re.fullmatch(r"pendmap\[(.*)\]", every)
    assert named is not None
    assert set(named[1].split(",")) == set(EXTRAS) - {"all", "dev", "docs"}
    used = {each for name in ("viewer", "zarr", "dask") for each in EXTRAS[name]}
    assert {each for each in used if "pendmap[" not in each} <= set(EXTRAS["dev"])
    # `maturin develop --extras` would look for these in an index.
    assert not [each for each in EXTRAS["dev"] + EXTRAS["viewer"] if "pendmap[" in each]


MODULES = ["pendmap"] + [
    module.name
    for module in pkgutil.walk_packages(pendmap.__path__, "pendmap.")
    if not module.name.endswith(("__main__", "_core"))
]


@pytest.mark.parametrize("name", MODULES)
def test_examples_print_the_stated_output(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    for test in doctest.DocTestFinder().find(importlib.import_module(name)):
        runner.run(test)
    assert not runner.failures


def test_every_public_function_has_an_example() -> None:
    public = [getattr(pendmap, name) for name in pendmap.__all__]
    functions = [one for one in public if inspect.isfunction(one)]
    assert not [one.__name__ for one in functions if ">>> " not in (one.__doc__ or "")]
