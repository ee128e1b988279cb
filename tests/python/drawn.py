"""Figures drawn without a file, and what stands in them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib import rc_context
from matplotlib.text import Text

from pendmap.figures import (
    basins,
    diagrams,
    exponents,
    lifetimes,
    melnikov,
    orbits,
    planes,
    style,
    tongues,
    trajectory,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def made(dataset: xr.Dataset, layer: str | None = None) -> Figure:
    kinds = {
        "basins": basins,
        "bifurcation": diagrams,
        "orbits": orbits,
        "parameter_map": planes,
        "lifetime": lifetimes,
        "lyapunov": exponents,
        "melnikov": melnikov,
        "tongues": tongues,
        "trajectory": trajectory,
    }
    draw = kinds[dataset.attrs["kind"]].figure
    with rc_context(style.RC):
        figure = draw(dataset, layer=layer, size=None, dpi=100.0, colormap=None)
        figure.canvas.draw()
    return figure


def titles(figure: Figure) -> list[str]:
    found = (axes.get_title(loc="left") for axes in figure.axes)
    return [text.removeprefix(f"({text[1:2]}) ") for text in found if text]


def named(figure: Figure) -> list[str]:
    return [text.get_text() for box in figure.legends for text in box.get_texts()]


def written(figure: Figure) -> str:
    texts = (found.get_text() for found in figure.findobj(Text) if isinstance(found, Text))
    return " ".join(" ".join(texts).split())
