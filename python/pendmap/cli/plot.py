"""``pendmap plot``: a result drawn again."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.parse.options import argument, group, new_command, output_options
from pendmap.cli.parse.signature import options_of, parameters
from pendmap.cli.parse.types import FILE, OptionType
from pendmap.cli.show import Outputs
from pendmap.errors import InputError, named

if TYPE_CHECKING:
    from pathlib import Path


def _size(text: str) -> tuple[float, float]:
    try:
        width, height = (float(part) for part in text.lower().split("x"))
    except ValueError:
        raise InputError(f"must be WIDTHxHEIGHT in inches, got {text!r}") from None
    return width, height


_DRAW = "render.draw"
_LOOK = group("Look", "--layer settle --width 86 --no-title")
_LAYER = OptionType(
    "name", str, lambda: re.findall(r"``([\w-]+)``", parameters(_DRAW)["layer"].text)
)


@new_command(
    "plot",
    "pendmap plot basins.nc --layer settle --out settle.svg",
    "pendmap plot basins.nc --width 86 --no-title --out column.pdf",
    "pendmap plot basins.nc --out basins.rrd",
)
@argument("file", "FILE", FILE)
@options_of(
    _DRAW, "layer size width dpi colormap title", _LOOK, layer=_LAYER, size=OptionType("WxH", _size)
)
@output_options((), json="")
def command(*, file: Path, **given: Any) -> None:  # noqa: ANN401 (outputs, look)
    """Draw a result again, in another size, colours or layer, without computing.

    FILE is a result, .nc or .zarr. Figures and recordings are written; if none is named, FILE.png.
    """
    if not file.name:
        raise click.UsageError(f"{str(file)!r}: must be a result, .nc or .zarr, it is a folder")
    outputs = Outputs.take(given, str(file.with_suffix("")), [file], default=("plot",))

    from pendmap.files.dataset import load

    result = load(file)
    with named(str(file)):
        try:
            written = outputs.write(result, **given)
        except (InputError, MemoryError):
            raise
        except Exception as error:
            # The content of the file is not checked: invalid values may raise any error.
            raise InputError(
                f"cannot be drawn: its content is not a result's: {type(error).__name__}: {error}"
            ) from error
    outputs.finish(written, lambda: {"files": [*written]}, [])
