"""The page of commands: what ``pendmap COMMAND --help`` prints."""

from __future__ import annotations

from pathlib import Path

from pendmap.cli.main import command

HERE = Path(__file__).resolve().parents[1]
INTRODUCTION = """# Commands

`pendmap COMMAND --help` prints these texts. With `--json` a command writes no file, except
`diagnose`, which still writes its model, and `rig` and `paper`, which only write files. The exit
code is 0 if all was done, 1 if not, 2 for bad input and 130 after an interrupt.
"""


def page() -> str:
    """Return the page."""
    parts = [INTRODUCTION]
    with command.make_context("pendmap", [], resilient_parsing=True) as above:
        names = command.list_commands(above)
        for name in ["", *names]:
            called = command.get_command(above, name) if name else command
            if called is None:
                continue
            with called.make_context(name, [], above, resilient_parsing=True) as own:
                text = called.get_help(own if name else above)
            parts.append(f"## pendmap {name}".rstrip() + f"\n\n```text\n{text}\n```\n")
    return "\n".join(parts)


def write() -> None:
    """Write the page where its text has changed."""
    path, text = HERE / "commands.md", page()
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
