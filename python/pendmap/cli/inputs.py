"""A command never overwrites its inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path


def keep_inputs(
    inputs: Iterable[Path | None], outputs: Mapping[str, Iterable[Path | None]]
) -> None:
    """Refuse outputs, by their option, that are inputs, or folders that hold one."""
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
    """Return the files of a report without its figures; a folder holds one of either kind."""
    if report is None:
        return []
    in_folder = report.is_dir() or not report.suffix
    return [report / "report.html", report / "report.md"] if in_folder else [report]
