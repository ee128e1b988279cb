"""Commands, snippets and links of README.md and of the pages in docs; the built site."""

from __future__ import annotations

import importlib.util
import re
import shlex
import subprocess
import sys
import tomllib
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

import pytest

from conftest import run_command
from pendmap.records.description import description_of

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
OWN_TESTS = {"cells.md", "gallery.md"}
"""Pages whose snippets tests of their own run, in a folder with records."""
GENERATED = {"_build", "effects", "commands.md", "results.md"}
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
        finished = run_command(tmp_path, *words[1:])
        assert finished.returncode == 0, f"{words}: {finished.stderr}"


def test_make_knows_the_other_commands() -> None:
    others = [line for line in commands() if line[0] != "pendmap"]
    assert ["make", "demo"] in others
    assert ["make", "test"] in others
    for words in others:
        subprocess.run([*words, "--dry-run"], cwd=ROOT, capture_output=True, check=True)


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
        described = description_of(tomllib.loads(text))
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
    generated = {"commands.md", "results.md", "effects/index.md", "api/index.md"}
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


class Page(HTMLParser):
    """Anchors, links and loaded files of a page."""

    def __init__(self, path: Path) -> None:
        """Read a page."""
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag refers to."""
        given = {name: value for name, value in attrs if value is not None}
        self.anchors.update(given[name] for name in ("id", "name") if name in given)
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        elif tag in {"img", "script", "iframe", "source"} and "src" in given:
            self.loaded.append(given["src"])
        elif tag == "link" and "href" in given:
            self.loaded.append(given["href"])


@pytest.mark.manual
def test_the_site_builds_and_every_link_has_a_target(tmp_path: Path) -> None:
    pytest.importorskip("sphinx", reason="the extra docs is not installed")
    site = tmp_path / "site"
    words = ["-m", "sphinx", "-W", "--keep-going", "-n", "-q", "docs", str(site)]
    run = subprocess.run(
        [sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    assert not run.stderr
    pages = {path: Page(path) for path in site.rglob("*.html")}
    assert len(pages) > 60
    broken = []
    for path, page in pages.items():
        for target in [*page.links, *page.loaded]:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                if target in page.loaded:
                    broken.append(f"{path.name} loads {target}")
                continue
            aim = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not aim.exists():
                broken.append(f"{path.name}: {target}")
            elif parts.fragment and aim in pages:
                anchor = unquote(parts.fragment)
                if anchor not in pages[aim].anchors and anchor != "top":
                    broken.append(f"{path.name}: {target}")
    assert not broken, broken
