"""Sheets whose panels are placed by the inch."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pendmap.render import drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEFT, TOP = 0.72, 0.98
"""Inches left of a panel, and above it with title and subtitle."""


def headed(size: tuple[float, float], dpi: float, title: str, subtitle: str) -> Figure:
    """Return an empty figure of ``size`` inches with its title and subtitle."""
    figure = Figure(figsize=size, dpi=dpi)
    FigureCanvasAgg(figure)
    drawing.write_head(figure, title, subtitle)
    return figure


def place(figure: Figure, x: float, y: float, width: float, height: float) -> Axes:
    """Add axes by the inch, from the figure's lower left corner."""
    whole = figure.get_size_inches()
    return figure.add_axes((x / whole[0], y / whole[1], width / whole[0], height / whole[1]))
