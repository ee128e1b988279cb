"""Commands and snippets of README.md and of the pages in docs are run."""

from __future__ import annotations

import importlib.util
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from conftest import run_command
from pendmap.records.description import read_description

if TYPE_CHECKING:
    from conftest import Run

ROOT = Path(__file__).resolve().parents[3]
SPEC = importlib.util.spec_from_file_location("outputs", ROOT / "docs" / "outputs.py")
assert SPEC is not None
assert SPEC.loader is not None
outputs = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(outputs)
README = (ROOT / "README.md").read_text(encoding="utf-8")
RAW = "https://raw.githubusercontent.com/pendmap/pendmap/main/"
PATIENCE = 120.0
"""Upper bound on the processor time of a command, s."""
OWN_TESTS = {"cells.md", "gallery.md"}
"""Pages whose snippets tests of their own run, in a folder with records."""
GENERATED = {"_build", "effects", "commands.md"}
PAGES = [
    ROOT / "README.md",
    *(
        page
        for page in sorted((ROOT / "docs").rglob("*.md"))
        if not GENERATED & set(page.relative_to(ROOT / "docs").parts)
    ),
]


def marks(page: Path) -> list[pytest.MarkDecorator]:
    """Return the mark of pages in docs, whose commands are tests of the manual."""
    return [] if page.name == "README.md" else [pytest.mark.manual]


def blocks(language: str, text: str = README) -> list[str]:
    """Return all code blocks in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def commands(text: str = README) -> list[list[str]]:
    """Return all commands, each split into words."""
    lines = [line for block in blocks("sh", text) for line in block.splitlines()]
    return [shlex.split(line, comments=True) for line in lines]


SNIPPETS = [
    pytest.param(code, id=f"{page.name} {k}", marks=marks(page))
    for page in PAGES
    if page.name not in OWN_TESTS
    for k, code in enumerate(blocks("python", page.read_text(encoding="utf-8")))
]

PROMISED = {
    page: [line for line in commands(page.read_text(encoding="utf-8")) if line[0] == "pendmap"]
    for page in PAGES
}


def written(words: list[str]) -> str | None:
    """Return the name, without extension, of the files that a command writes."""
    if "--out" in words:
        return Path(words[words.index("--out") + 1]).stem
    return None if {"--json", "--plot", "--rerun", "--view"} & set(words) else words[1]


def needed(place: int, lines: list[list[str]]) -> list[int]:
    """Return indices of the commands a command needs: the last one to write each name in it."""
    names = {Path(word).parts[0].partition(".")[0] for word in lines[place][2:]}
    last = {written(lines[k]): k for k in range(place)}
    return sorted({k for k in map(last.get, names) if k is not None})


def children_seconds() -> float:
    """Return the processor time, s, of all ended child processes."""
    spent = os.times()
    return spent.children_user + spent.children_system


def together(lines: list[list[str]]) -> list[list[int]]:
    """Return the groups of dependent commands as indices in order, each command once."""
    groups: list[set[int]] = []
    for place in range(len(lines)):
        own = {place, *needed(place, lines)}
        groups = [
            *(group for group in groups if not group & own),
            own.union(*(group for group in groups if group & own)),
        ]
    return sorted(sorted(group) for group in groups)


@pytest.mark.parametrize(
    ("page", "places"),
    [
        pytest.param(
            page, places, id=f"{page.name} {places[-1]} {lines[places[-1]][1]}", marks=marks(page)
        )
        for page, lines in PROMISED.items()
        for places in together(lines)
    ],
)
def test_every_command_runs(page: Path, places: list[int], tmp_path: Path) -> None:
    for words in (PROMISED[page][place] for place in places):
        began = children_seconds()
        finished = run_command(tmp_path, *words[1:])
        assert finished.returncode == 0, f"{words}: {finished.stderr}"
        assert children_seconds() - began < PATIENCE


def test_the_pages_contain_commands() -> None:
    for name, least in {"README.md": 2, "basins.md": 7, "diagnose.md": 5}.items():
        assert any(page.name == name and len(PROMISED[page]) >= least for page in PAGES)


def test_make_knows_the_other_commands() -> None:
    others = [line for line in commands() if line[0] != "pendmap"]
    assert ["make", "demo"] in others
    assert ["make", "test"] in others
    for words in others:
        run = subprocess.run(
            [*words, "--dry-run"], cwd=ROOT, capture_output=True, text=True, check=False
        )
        assert run.returncode == 0, run.stderr
        if words[1] == "demo":
            assert "pendmap basins --p 1.7" in run.stdout


@pytest.mark.parametrize("code", SNIPPETS)
def test_every_snippet_runs(code: str, tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(block, id=f"{page.name} {k}", marks=marks(page))
        for page in PAGES
        for k, block in enumerate(blocks("toml", page.read_text(encoding="utf-8")))
    ],
)
def test_every_toml_block_is_a_valid_file_of_its_kind(
    text: str, tmp_path: Path, pendmap_command: Run
) -> None:
    if "[columns]" in text:
        (tmp_path / "a.csv").write_text("t_s,volts,amplitude_rad\n0,1,1\n", encoding="utf-8")
        text += '[[run]]\nfile = "a.csv"\nkind = "free"\n'
        (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
        described = read_description(tmp_path / "experiment.toml")
        assert described.columns["angle"].name == "volts"
        return
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    drive = ("--stroke-mm", "20", "--frequency-hz", "1.9")
    model = ("simulate", "--model", "own.toml", *drive, "--until", "30")
    formulas = ("effects", "--effects", "own.toml", "--json")
    run = pendmap_command(*(model if "[pendulum]" in text else formulas))
    assert run.returncode == 0, run.stderr
    if "[pendulum]" in text:
        assert all((tmp_path / f"simulate.{kind}").exists() for kind in ("nc", "png", "rrd"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_has_a_target(page: Path) -> None:
    block = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
    prose = block.sub("", page.read_text(encoding="utf-8"))
    generated = {"commands.md", "effects/index.md", "api/index.md"}
    for target in re.findall(r"\]\(<?([^)#>]+)(?:#[^)>]*)?>?\)", prose):
        if target.startswith(RAW):
            assert (ROOT / target.removeprefix(RAW)).exists(), target
        elif not target.startswith("http") and target not in generated:
            assert (page.parent / target).exists(), target


@pytest.mark.parametrize(
    "page", [pytest.param(p, id=p.name, marks=marks(p)) for p in outputs.pages()]
)
def test_every_output_is_what_is_printed(page: Path) -> None:
    said = outputs.comparable(page.read_text(encoding="utf-8"))
    assert outputs.comparable(outputs.rewritten(page)) == said


def test_the_readme_is_short() -> None:
    assert len(README.splitlines()) <= 150
