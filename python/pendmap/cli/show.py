"""Progress on the terminal, results in files."""

from __future__ import annotations

import contextlib
import json
import math
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

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
    """Write the files asked for, then JSON or the summary to stdout."""
    written = []
    if outputs.out is not None:
        from pendmap.store import save

        written.append(save(dataset, outputs.out))
    if outputs.plot is not None:
        from pendmap import figures

        written.append(figures.draw(dataset, outputs.plot))
    if outputs.rerun is not None:
        from pendmap import viewer

        written.append(viewer.record(dataset, outputs.rerun))
    if outputs.as_json:
        click.echo(json.dumps(plain(as_json(dataset)), allow_nan=False))
    elif not outputs.quiet:
        click.echo(dataset.attrs["title"])
        click.echo(dataset.attrs["summary"])
        if written:
            click.echo("Written: " + ", ".join(str(path) for path in written))
    if outputs.view and outputs.rerun is not None:
        from pendmap import viewer

        try:
            viewer.open_viewer(outputs.rerun)
        except viewer.ViewerError as error:
            raise click.ClickException(str(error)) from error


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
