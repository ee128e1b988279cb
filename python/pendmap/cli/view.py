"""``pendmap view``: the viewer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pendmap.cli.parse.options import argument, new_command

if TYPE_CHECKING:
    from pathlib import Path


@new_command("view", "pendmap view basins.rrd")
@argument("file", "FILE")
def command(*, file: Path) -> None:
    """Open a recording (.rrd) in the Rerun viewer."""
    from pendmap import viewer

    viewer.open_viewer(file)
