"""Progress on the terminal, results in files."""

from __future__ import annotations

import contextlib
import functools
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pendmap.errors import InputError, NotWrittenError, one_line
from pendmap.files import COMPLETE, held_interrupts
from pendmap.formatting import columns

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    import xarray as xr

    from pendmap.analysis.result import Schema
    from pendmap.cli.options import Outputs


@contextlib.contextmanager
def progress_bar(name: str, *, shown: bool) -> Iterator[Callable[[int, int], None] | None]:
    """Show a bar with the time left on stderr; give its callback, or None."""
    if not shown:
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(name, total=None)

        def report(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total or None)

        yield report


def show(dataset: xr.Dataset, outputs: Outputs, schema: Schema) -> None:
    """Write the files asked for, then JSON or the summary to stdout."""
    files = ((functools.partial(write, dataset), path) for write, path in _files(outputs))
    written = write_all(files)
    if outputs.as_json:
        write_json(schema.json(dataset))
    elif not outputs.quiet:
        click.echo(dataset.attrs["title"])
        click.echo(dataset.attrs["summary"])
        written.say()
    written.check()
    open_viewer(outputs)


def write_json(fields: dict[str, Any]) -> None:
    """Write one JSON object to stdout."""
    click.echo(json.dumps(plain(fields), allow_nan=False))


class Written(list[str]):
    """Names of the files that are complete, and why others are not."""

    def __init__(self) -> None:
        super().__init__()
        self.missed: list[str] = []
        self.refused: list[InputError] = []

    def name(self, path: Path | None) -> str | None:
        """Return the name of a file that is complete, none of another."""
        return str(path) if str(path) in self else None

    def say(self) -> None:
        """Say which files are complete, if any are."""
        if self:
            click.echo("Written: " + ", ".join(map(one_line, self)))

    def check(self) -> None:
        """End the command with an error where a file was refused, or not taken by the disk."""
        if self.refused:
            raise self.refused[0]
        if self.missed:
            complete = ", ".join(self) or "nothing"
            raise NotWrittenError(f"{'; '.join(self.missed)}; written: {complete}")


def write_all(
    files: Iterable[tuple[Callable[[Path], Path | str], Path]], *, keep: bool = False
) -> Written:
    """Write files one after the other, an interrupt between two of them; return their names.

    Where the disk does not take one, the others are tried all the same (:meth:`Written.check`).
    What cannot be put into a file is refused and leaves none, unless ``keep`` asks for the others.
    """
    written = Written()
    for write, path in files:
        with held_interrupts():
            try:
                written.append(str(write(path)))
                COMPLETE.append(written[-1])
            except InputError as error:
                if not keep:
                    for name in written:
                        Path(name).unlink(missing_ok=True)
                        COMPLETE.remove(name)
                    raise
                written.refused.append(error)
            except OSError as error:
                written.missed.append(f"cannot write {path}: {error.strerror or error}")
    return written


def open_viewer(outputs: Outputs) -> None:
    """Open the viewer on the recording where --view asks for it."""
    if outputs.view and outputs.rerun is not None:
        open_recording(outputs.rerun)


def open_recording(path: Path) -> None:
    """Open the viewer on a recording."""
    from pendmap import viewer

    try:
        viewer.open_viewer(path)
    except viewer.ViewerError as error:
        raise click.ClickException(str(error)) from error


def _files(outputs: Outputs) -> Iterator[tuple[Callable[[xr.Dataset, Path], Path], Path]]:
    # Each is imported when its turn comes: matplotlib and Rerun take a while.
    if outputs.out is not None:
        from pendmap.files.dataset import save

        yield save, outputs.out
    if outputs.plot is not None:
        from pendmap import render

        yield render.draw, outputs.plot
    if outputs.rerun is not None:
        from pendmap import viewer

        yield viewer.record, outputs.rerun


def write_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Write a table in columns as wide as they need, however wide the terminal is."""
    first, *others = columns(head, rows).split("\n")
    click.echo("\n".join([click.style(first, bold=True), *others]))


def plain(value: Any) -> Any:  # noqa: ANN401 (any part of a JSON object)
    """Return numbers of numpy as Python's own, and numbers that are not finite as null."""
    if isinstance(value, dict):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
