"""Charts over parameters of a model: their axes, counts in steps, layers over two of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Literal

from pendmap.charts import names, plane
from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.marks import Colours
from pendmap.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import xarray as xr

    from pendmap.charts.marks import Ends, Floats, Mark

    Layer = Callable[[str, Ends, Ends], tuple[str, list[Mark]]]

_MOST_COUNT: Final = 8  # Largest count that has its own colour


def axis(dataset: xr.Dataset, name: str) -> Axis:
    """Return the axis of a parameter, with its unit, as wide as the cells."""
    symbol = names.symbol(name, str(dataset[name].attrs.get("units", "1")))
    return Axis(symbol, plane.outer_edges(dataset, name))


def over(varied: Sequence[str]) -> str:
    """Return the symbols of the parameters that vary, for a title."""
    return " and ".join(names.symbol(name) for name in varied)


def counts(name: str, values: Floats, least: int = 0) -> Colours:
    """Return the colour scale of whole numbers from ``least`` on."""
    top = int(min(values.max(initial=1), _MOST_COUNT))
    beyond: Literal["max", "neither"] = "max" if values.max(initial=0) > top else "neither"
    ticks = [float(k) for k in range(least, top + 1)]
    return Colours(name, "viridis", least - 0.5, top + 0.5, "counts", beyond, ticks)


def layers(  # noqa: PLR0913, PLR0917 (parts of a chart)
    dataset: xr.Dataset,
    varied: tuple[str, str],
    titles: tuple[str, str],
    make: Layer,
    known: Sequence[str],
    shown: tuple[Sequence[str], Sequence[str]],
    layer: str | None,
) -> Chart:
    """Return a panel of each layer over two parameters, the first one to the right.

    ``make`` returns title and marks of a layer between the ends of both axes. A figure shows
    the first of ``shown``, a recording all; or both the ``layer`` alone, one of those ``known``.
    """
    if layer not in {None, *known}:
        raise InputError(f"no layer {layer!r} in this figure; it has {', '.join(known)}")
    across, up = (plane.outer_edges(dataset, name) for name in varied)
    sides = axis(dataset, varied[0]), axis(dataset, varied[1])
    panels = []
    for name in [layer] if layer else [*shown[0], *shown[1]]:
        title, marks = make(name, across, up)
        panels.append(Panel(name, title, *sides, marks))
    return Chart(*titles, [panels[: len(shown[0])]], recorded=panels, ratio=0.85, tabs=True)
