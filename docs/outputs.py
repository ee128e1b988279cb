"""Outputs in README.md and the pages of docs: ``make outputs`` rewrites them.

A ``console`` block has lines ``$ pendmap ...``, each followed by what it prints; a ``text`` block
right after a ``python`` block is what that code prints. Blocks of one page run in one folder, in
order. A comparison ignores how many seconds or minutes are stated, the number of threads and the
instruction set.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(
    r"(?P<head>^```console\n)(?P<console>.*?)(?P<tail>^```$)"
    r"|(?P<code>^```python\n(?P<python>[^`]*?)^```\n+```text\n)(?P<text>.*?)(?P<end>^```$)",
    re.MULTILINE | re.DOTALL,
)
MACHINE = re.compile(
    r"\d[\d.]*(?= ?(?:s|seconds?|minutes?|threads?)\b)|\((?:avx512|avx2|neon|sse|portable)\)"
)


def pages() -> list[Path]:
    """Return the pages with outputs; generated pages are left out."""
    known = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    generated = ("_build", "effects")
    return [
        page
        for page in known
        if not set(generated) & set(page.relative_to(ROOT).parts)
        and BLOCK.search(page.read_text(encoding="utf-8"))
    ]


def printed(words: list[str], folder: Path) -> str:
    """Return what a Python command prints to stdout, in 80 columns."""
    place = os.pathsep.join(filter(None, [str(ROOT / "python"), os.environ.get("PYTHONPATH")]))
    run = subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=os.environ | {"COLUMNS": "80", "PYTHONPATH": place},
        capture_output=True,
        text=True,
        check=True,
    )
    return "\n".join(line.rstrip() for line in run.stdout.splitlines()).strip("\n") + "\n"


def replaced(block: re.Match[str], folder: Path) -> str:
    """Return a block with what its commands print now."""
    if block["python"] is not None:
        return block["code"] + printed(["-c", block["python"]], folder) + block["end"]
    parts = []
    for line in block["console"].splitlines():
        if line.startswith("$ pendmap "):
            words = shlex.split(line, comments=True)[2:]
            parts.append(f"{line}\n{printed(['-m', 'pendmap', *words], folder)}")
    return block["head"] + "".join(parts) + block["tail"]


def rewritten(page: Path) -> str:
    """Return the text of a page with the outputs of now."""
    with tempfile.TemporaryDirectory() as folder:
        text = page.read_text(encoding="utf-8")
        return BLOCK.sub(lambda block: replaced(block, Path(folder)), text)


def comparable(text: str) -> str:
    """Return a text in which durations, threads and instruction sets are equal."""
    return MACHINE.sub("N", text)


if __name__ == "__main__":
    for each in pages():
        each.write_text(rewritten(each), encoding="utf-8")
        print(each.relative_to(ROOT))
