"""``pendmap plot``: a result drawn again."""

from __future__ import annotations

import math
from pathlib import Path, PurePath
from typing import Any

import click

from pendmap.cli.parse.groups import argument, group, new_command
from pendmap.cli.parse.options import flag, option, output_options
from pendmap.cli.parse.types import NUMBER, RESULT, Address, OptionType
from pendmap.cli.show import Outputs, write_all
from pendmap.errors import InputError, named

_LAYERS = {
    "basins": "labels settle turns exponent",
    "basins over draws": "probability entropy",
    "a map": "kinds exponent attractors period winding undecided",
    "a map over draws": "certainty",
    "a trajectory": "history energy phase section",
    "a bifurcation diagram": "theta velocity sweeps exponent",
    "a sweep": "fraction entropy uncertainty exponent",
    "a sweep over two": "entropy boundary uncertainty attractors main undecided",
    "critical curves": "omega-p e-alpha2",
}
"""Names of layers, by what has them."""
_SHOWN = "; ".join(f"{', '.join(names.split())} of {what}" for what, names in _LAYERS.items())
_LAYER = OptionType("name", str, lambda: [*dict.fromkeys(" ".join(_LAYERS.values()).split())])
_LOOK = group("Look", "--layer settle --width 86 --no-title")


@new_command(
    "plot",
    "pendmap plot basins.nc --layer settle --out settle.svg",
    "pendmap plot basins.nc --width 86 --no-title --out column.pdf",
    "pendmap plot basins.nc --out basins.rrd",
)
@argument("file", "FILE", RESULT)
@option(
    "--layer",
    _LAYER,
    f"One part only: {_SHOWN}; 'share KIND' of a map.",
    group=_LOOK,
)
@option("--size", str, "Width x height in inches, like 8x4.", group=_LOOK)
@option(
    "--width",
    NUMBER,
    "Width in mm: 86 is a journal's column, 178 are two.",
    group=_LOOK,
)
@flag("--no-title", "No title and subtitle, for a figure with a caption.", group=_LOOK)
@option("--dpi", click.IntRange(20, 1200), "Pixels an inch of a .png.", group=_LOOK)
@option("--colormap", str, "Colours of the fields, by matplotlib's names.", group=_LOOK)
@output_options((), json="")
def command(  # noqa: PLR0913 (the options above)
    *,
    file: Path | Address,
    layer: str | None,
    size: str | None,
    width: float | None,
    no_title: bool,
    dpi: int | None,
    colormap: str | None,
    **given: Any,  # noqa: ANN401 (outputs)
) -> None:
    """Draw a result again, in another size, colours or layer, without computing.

    FILE is a result, .nc or .zarr, or the address of a .zarr. Figures and recordings are written;
    if none is named, FILE.png, for an address in this folder.
    """
    if size and width:
        raise click.UsageError("only one of --size and --width must be given, got both")
    if width is not None and not 0 < width < math.inf:
        raise click.UsageError(f"--width must be positive, in mm, got {width:g}")
    look: dict[str, Any] = {"size": _size(size), "width": width, "title": not no_title}
    at_address = isinstance(file, Address)
    if not PurePath(file).name:
        raise click.UsageError(f"{str(file)!r}: must be a result, .nc or .zarr, it is a folder")
    name = PurePath(file).stem if at_address else str(PurePath(file).with_suffix(""))
    outputs = Outputs.take(given, name, reads=[] if at_address else [Path(file)], default=["plot"])

    from pendmap.files.dataset import load

    result = load(file)
    look |= {"layer": layer, "dpi": dpi, "colormap": colormap}
    with named(str(file)):
        try:
            written = write_all(outputs.files(result, None, look=look))
        except (InputError, MemoryError):
            raise
        except Exception as error:
            # The content of the file is not checked: invalid values may raise any error.
            raise InputError(
                f"cannot be drawn: its content is not a result's: {type(error).__name__}: {error}"
            ) from error
    outputs.finish(written, lambda: {"files": [*written]}, [])


def _size(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        width, height = (float(part) for part in text.lower().split("x"))
    except ValueError:
        raise click.UsageError(f"--size must be WIDTHxHEIGHT in inches, got {text!r}") from None
    return width, height
