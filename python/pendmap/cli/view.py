"""``pendmap view``: the viewer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from pendmap.cli.types import FILE

if TYPE_CHECKING:
    from pathlib import Path


@click.command("view")
@click.argument("file", type=FILE)
def command(*, file: Path) -> None:
    """Open a recording (.rrd) in the Rerun viewer."""
    from pendmap import viewer

    viewer.open_viewer(file)
