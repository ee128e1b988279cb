"""Pages of docs: links, citations and pictures exist, snippets of the gallery run."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

DOCS = Path(__file__).resolve().parents[3] / "docs"
THEORY = sorted((DOCS / "theory").glob("*.md"))
OWN = [*THEORY, *(DOCS / f"{name}.md" for name in ("cells", "comparison", "gallery", "paper"))]
GALLERY = runpy.run_path(str(DOCS / "pictures" / "gallery.py"))
SNIPPETS = GALLERY["snippets"]()
LARGEST = 200_000  # bytes
paged = pytest.mark.parametrize("page", OWN, ids=lambda page: page.stem)


@paged
def test_every_link_of_a_page_has_a_target(page: Path) -> None:
    for target in re.findall(r"\]\(<?([^)#>]+)[^)]*\)", page.read_text(encoding="utf-8")):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), target


@paged
def test_every_citation_has_an_entry(page: Path) -> None:
    entries = {
        key
        for path in DOCS.glob("*.bib")
        for key in re.findall(r"^@\w+\{([^,]+),", path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    for keys in re.findall(r"\{cite:p\}`([^`]+)`", page.read_text(encoding="utf-8")):
        assert {key.strip() for key in keys.split(",")} <= entries, keys


@pytest.mark.parametrize("page", THEORY, ids=lambda page: page.stem)
def test_files_that_a_page_on_theory_names_exist(page: Path) -> None:
    named = re.findall(r"`((?:src|tests|benchmarks|python)/[\w/.]+)`", page.read_text("utf-8"))
    for name in named:
        assert (DOCS.parent / name).exists(), name


def test_every_picture_of_the_gallery_has_a_snippet_and_is_small() -> None:
    pictures = {path.name for path in (DOCS / "pictures").glob("gallery_*.png")}
    assert pictures == set(SNIPPETS)
    for name in pictures:
        assert (DOCS / "pictures" / name).stat().st_size < LARGEST, name


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return the folders with the records that snippets of the gallery read."""
    folders: dict[str, Path] = GALLERY["experiments"](tmp_path_factory.mktemp("gallery"))
    return folders


@pytest.fixture
def own_style() -> Iterator[None]:
    """Draw in the style of pendmap's files, and close all figures afterwards."""
    with mpl.rc_context():
        plt.style.use("pendmap.figures")
        yield
    plt.close("all")


@pytest.mark.manual
@pytest.mark.parametrize("name", SNIPPETS)
@pytest.mark.usefixtures("own_style")
def test_a_snippet_of_the_gallery_draws_a_figure(name: str, records: dict[str, Path]) -> None:
    figure = GALLERY["draw"](SNIPPETS[name], records)
    assert any(ax.has_data() for ax in figure.axes)
