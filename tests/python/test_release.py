"""What is published: version, extras, links."""

from __future__ import annotations

import re
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any

import pendmap
from pendmap import _core

ROOT = Path(__file__).resolve().parents[2]


def parsed(name: str) -> dict[str, Any]:
    return tomllib.loads((ROOT / name).read_text(encoding="utf-8"))


PROJECT = parsed("pyproject.toml")["project"]
EXTRAS: dict[str, list[str]] = PROJECT["optional-dependencies"]


def test_one_version_stands_everywhere() -> None:
    version = parsed("Cargo.toml")["workspace"]["package"]["version"]
    assert pendmap.__version__ == _core.__version__ == version
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {version}\n" in citation
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"\n## {version} - " in changes


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


def test_links_lead_to_one_repository() -> None:
    repository = parsed("Cargo.toml")["workspace"]["package"]["repository"]
    assert all(link.startswith(repository) for link in PROJECT["urls"].values())
    assert f"repository-code: {repository}\n" in (ROOT / "CITATION.cff").read_text("utf-8")
