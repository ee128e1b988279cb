"""``pendmap view``: the viewer."""

from __future__ import annotations

from pathlib import Path

import click


@click.command("view")
@click.argument("file", type=click.Path(path_type=Path))
def command(*, file: Path) -> None:
    """Open a recording (.rrd) in the Rerun viewer."""
    if not file.is_file():
        raise click.UsageError(f"{str(file)!r}: no such file")

    from pendmap import viewer

    try:
        viewer.open_viewer(file)
    except viewer.ViewerError as error:
        raise click.UsageError(str(error)) from error
