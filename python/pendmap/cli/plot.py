"""``pendmap plot``: a result drawn again."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.options import option
from pendmap.cli.show import write_all
from pendmap.cli.types import FILE, PICTURES, default_file, output_file
from pendmap.errors import InputError, named

if TYPE_CHECKING:
    from pathlib import Path


@click.command("plot")
@click.argument("file", type=FILE)
@option(
    "--out --plot out",
    output_file(*PICTURES),
    "Figure to write: .png .svg .pdf.  [default: FILE with .png]",
)
@click.option(
    "--layer",
    help="One part only: labels, settle, turns, exponent of basins, over draws probability and"
    " entropy; kinds, exponent, attractors, period, winding, undecided, 'share KIND', over draws"
    " certainty of a map; history, energy, phase, section of a trajectory; theta, velocity of a"
    " bifurcation diagram; omega-p, e-alpha2 of critical curves.",
)
@click.option("--size", help="Width x height in inches, like 8x4.")
@option("--width", click.FloatRange(40, 500), "Width in mm: 86 is a journal's column, 178 are two.")
@click.option(
    "--no-title", is_flag=True, help="No title and subtitle, for a figure with a caption."
)
@option("--dpi", click.IntRange(20, 1200), "Pixels an inch of a .png.")
@click.option("--colormap", help="Colours of the fields, by matplotlib's names.")
@click.option("--quiet", is_flag=True, help="Do not list the files written.")
def command(  # noqa: PLR0913 (the options above)
    *,
    file: Path,
    out: Path | None,
    layer: str | None,
    size: str | None,
    width: float | None,
    no_title: bool,
    dpi: int | None,
    colormap: str | None,
    quiet: bool,
) -> None:
    """Draw a result again, in another size, colours or layer, without computing."""
    if size and width:
        raise click.UsageError("only one of --size and --width must be given, got both")
    look: dict[str, Any] = {"size": _size(size), "width": width, "title": not no_title}
    if not file.name:
        raise click.UsageError(f"{str(file)!r}: must be a result, .nc or .zarr, it is a folder")
    target = out or default_file(file.with_suffix(".png"))

    from pendmap import render
    from pendmap.files.dataset import load

    draw = functools.partial(
        render.draw, load(file), layer=layer, dpi=dpi, colormap=colormap, **look
    )
    with named(str(file)):
        try:
            written = write_all([(draw, target)])
        except (InputError, MemoryError):
            raise
        except Exception as error:
            # The content of the file is not checked: invalid values may raise any error.
            raise InputError(
                f"cannot be drawn: its content is not a result's: {type(error).__name__}: {error}"
            ) from error
    if written and not quiet:
        written.say()
    written.check()


def _size(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        width, height = (float(part) for part in text.lower().split("x"))
    except ValueError:
        raise click.UsageError(f"--size must be WIDTHxHEIGHT in inches, got {text!r}") from None
    if not (1 <= width <= 100 and 1 <= height <= 100):  # noqa: PLR2004
        raise click.UsageError(f"--size must be 1 to 100 inches, got {text!r}")
    return width, height
