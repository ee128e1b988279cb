"""Write the man pages, one a command, from the texts of --help: `make man`."""

from __future__ import annotations

import re
import textwrap
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from pendmap.cli.main import command

if TYPE_CHECKING:
    import click

FOLDER = Path(__file__).resolve().parents[1] / "python/pendmap.data/data/share/man/man1"
WIDTH = 72  # A page has a margin
SECTION = re.compile(r"\n(?=[A-Z][A-Za-z ]*:\n)")
"""Beginning of a section of --help."""


def roff(text: str) -> str:
    """Return lines that are shown as they are."""
    plain = text.replace("\\", r"\e").replace("-", r"\-").replace("'", r"\(aq")
    plain = textwrap.dedent(plain)
    lines = (rf"\&{line}" if line.startswith(".") else line for line in plain.splitlines())
    return "\n".join([".nf", *lines, ".fi"])


def page(name: str, context: click.Context) -> str:
    """Return the man page of a command, or of all: each section of its help is one of the page."""
    title = f"pendmap-{name}" if name else "pendmap"
    usage, *sections = SECTION.split(context.get_help())
    synopsis, _, description = usage.removeprefix("Usage: ").partition("\n\n")
    purpose = description.strip().split("\n\n")[0].replace("\n", " ").strip()
    parts = [f'.TH {title.upper()} 1 "" "pendmap {version("pendmap")}" "pendmap"']
    parts += [".SH NAME", rf"{title} \- " + re.sub(r"\s+", " ", purpose).rstrip(".")]
    parts += [".SH SYNOPSIS", roff(synopsis), ".SH DESCRIPTION", roff(description.rstrip())]
    for section in sections:
        heading, _, body = section.partition(":\n")
        parts += [f".SH {heading.upper()}", roff(body.rstrip())]
    if name:
        parts += [".SH SEE ALSO", r"pendmap(1)"]
    else:
        others = ", ".join(rf"pendmap\-{each}(1)" for each in command.list_commands(context))
        parts += [".SH SEE ALSO", others]
    return "\n".join(parts) + "\n"


def pages() -> dict[str, str]:
    """Return all man pages by their file's name."""
    start = {"resilient_parsing": True, "terminal_width": WIDTH}
    with command.make_context("pendmap", [], **start) as whole:
        made = {"pendmap.1": page("", whole)}
        for name in command.list_commands(whole):
            called = command.get_command(whole, name)
            assert called is not None  # noqa: S101 (it is listed)
            with called.make_context(name, [], whole, **start) as context:
                context.formatter_settings = {**context.formatter_settings, "width": WIDTH}
                made[f"pendmap-{name}.1"] = page(name, context)
    return made


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    for old in FOLDER.glob("*.1"):
        old.unlink()
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
