"""Progress on the terminal, results in files."""

from __future__ import annotations

import contextlib
import json
import math
from typing import TYPE_CHECKING, Any

import click

from pendmap.files import held_interrupts

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    import xarray as xr

    from pendmap.cli.options import Outputs

__all__ = ["plain", "progress_bar", "show"]


@contextlib.contextmanager
def progress_bar(name: str, *, shown: bool) -> Iterator[Callable[[int, int], None] | None]:
    """A bar with the time left, on stderr; ``None`` where it is not shown."""
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


def show(dataset: xr.Dataset, outputs: Outputs, as_json: Callable[[xr.Dataset], Any]) -> None:
    """Write the files asked for, then JSON or the summary to stdout.

    An interrupt takes effect between two files and names those that are complete.
    """
    written: list[str] = []
    try:
        for write, path in _files(outputs):
            with held_interrupts():
                written.append(str(write(dataset, path)))
    except KeyboardInterrupt:
        raise KeyboardInterrupt(*written) from None
    if outputs.as_json:
        click.echo(json.dumps(plain(as_json(dataset)), allow_nan=False))
    elif not outputs.quiet:
        click.echo(dataset.attrs["title"])
        click.echo(dataset.attrs["summary"])
        if written:
            click.echo("Written: " + ", ".join(written))
    if outputs.view and outputs.rerun is not None:
        from pendmap import viewer

        try:
            viewer.open_viewer(outputs.rerun)
        except viewer.ViewerError as error:
            raise click.ClickException(str(error)) from error


def _files(outputs: Outputs) -> Iterator[tuple[Callable[[xr.Dataset, Path], Path], Path]]:
    # Each is imported when its turn comes: matplotlib and Rerun take a while.
    if outputs.out is not None:
        from pendmap.store import save

        yield save, outputs.out
    if outputs.plot is not None:
        from pendmap import figures

        yield figures.draw, outputs.plot
    if outputs.rerun is not None:
        from pendmap import viewer

        yield viewer.record, outputs.rerun


def plain(value: Any) -> Any:  # noqa: ANN401 (any part of a JSON object)
    """Numbers of numpy as Python's own; what is not finite as null."""
    if isinstance(value, dict):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
