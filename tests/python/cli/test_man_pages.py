"""The man pages are those of the texts of --help."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
FOUND = importlib.util.spec_from_file_location("man_pages", ROOT / "docs/man_pages.py")
assert FOUND is not None
assert FOUND.loader is not None
man_pages = importlib.util.module_from_spec(FOUND)
FOUND.loader.exec_module(man_pages)


def test_the_man_pages_are_those_of_make_man() -> None:
    stored = {path.name: path.read_text(encoding="utf-8") for path in man_pages.FOLDER.iterdir()}
    assert stored == man_pages.pages()


@pytest.mark.skipif(shutil.which("groff") is None, reason="groff sets man pages")
@pytest.mark.parametrize("path", sorted(man_pages.FOLDER.iterdir()), ids=lambda path: path.name)
def test_a_man_page_is_set_without_warnings_in_80_columns(path: Path) -> None:
    words = ["groff", "-man", "-Tutf8", "-k", "-ww", "-rLL=80n", "-P-c", str(path)]
    run = subprocess.run(words, capture_output=True, text=True, check=True)
    assert run.stderr == ""
    assert max(map(len, run.stdout.splitlines())) <= 80 + run.stdout.count("\b")
