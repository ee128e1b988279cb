"""What a command reads is never written over."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path


def keep_inputs(
    inputs: Iterable[Path | None], outputs: Mapping[str, Iterable[Path | None]]
) -> None:
    """Refuse outputs that are inputs, before anything is computed.

    Parameters
    ----------
    inputs : iterable of Path
        What is read.
    outputs : mapping of str to iterable of Path
        What is written, by the option that says so.

    Raises
    ------
    click.UsageError
        If one is the other, whatever path leads there, or a folder that is replaced holds it.
    """
    read = [path for path in inputs if path is not None and path.exists()]
    for option, paths in outputs.items():
        for output in paths:
            if output is not None and output.exists() and any(_takes(output, p) for p in read):
                raise click.UsageError(
                    f"Invalid value for '{option}': {str(output)!r}: is an input, which would be "
                    "lost: it must be another file"
                )


def _takes(output: Path, path: Path) -> bool:
    """Whether an input is lost where an output is written: a .zarr is a folder."""
    places = [path, *path.resolve().parents] if output.is_dir() else [path]
    return any(output.samefile(place) for place in places)


def report_files(report: Path | None) -> list[Path]:
    """Return the files of a report, but for its figures: a folder holds one of either kind."""
    if report is None:
        return []
    in_folder = report.is_dir() or not report.suffix
    return [report / "report.html", report / "report.md"] if in_folder else [report]
