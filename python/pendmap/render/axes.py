"""One part of a result in Axes of one's own."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.colors import is_color_like, to_hex
from matplotlib.transforms import ScaledTranslation

from pendmap.charts import registry
from pendmap.charts.chart import Chart
from pendmap.errors import InputError, check_type
from pendmap.render import drawing, marks, style, ticks

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from matplotlib.colors import Colormap

    from pendmap.charts.chart import Panel


def plot(  # noqa: PLR0913 (all of these a user may choose)
    result: Any,  # noqa: ANN401 (a dataset, records, or what was found in records)
    ax: Axes | None = None,
    *,
    layer: str | None = None,
    title: bool | str = True,
    legend: bool | None = None,
    colormap: str | Colormap | None = None,
    colors: Mapping[str, Any] | None = None,
    names: Mapping[str, str] | None = None,
) -> Axes:
    """Draw one part of any result into Axes, in the fonts and sizes of the user's style.

    Parameters
    ----------
    result : xarray.Dataset or other result
        Result of an analysis, of ``load``, ``read_experiment``, ``identify``, ``compare`` or
        ``diagnose``. A selection of a dataset is drawn with its own cells and shares; one map of a
        sweep, like ``swept.sel(p=0.6)``, as a basin map.
    ax : matplotlib.axes.Axes, optional
        By default those of a new figure of pyplot, which a notebook shows. Axes that show something
        already keep their title and their names; limits and legend grow.
    layer : str, optional
        The part, by default the first of the figure; an unknown one is answered with those of the
        result.
    title : bool or str
        False for none, or a text.
    legend : bool, optional
        Whether to write a legend below the panel. By default one higher than half the panel is left
        out.
    colormap : str or Colormap, optional
        Colour map of matplotlib, or its name, for layers of numbers.
    colors, names : mapping, optional
        Colours, as matplotlib knows them, and names of attractors, by their own names, like
        ``{"rotation 1:+1": "black"}``.

    Returns
    -------
    matplotlib.axes.Axes
        ``ax``, with marks, limits, ticks and labels. A figure without a layout gets the
        ``constrained`` one of matplotlib.

    Raises
    ------
    InputError
        For what has no figure, and for an unknown layer, colour map, attractor or colour.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import pendmap
    >>> fig, (left, right) = plt.subplots(1, 2, layout="constrained")
    >>> map_ = pendmap.basins(pendmap.Pendulum(p=0.6), pendmap.Grid.square(40))
    >>> ax = pendmap.plot(map_, left)
    >>> ax = pendmap.plot(map_, right, layer="settle", title=False)
    >>> plt.close(fig)
    """
    panel = _panel(result, layer, colormap, _colours(colors), names)
    if legend is not None:
        check_type("legend", legend, bool, "False")
    with style.DRAWING:
        if ax is None:
            from matplotlib import pyplot as plt  # noqa: PLC0415 (a display, only if needed)

            ax = plt.figure(layout="constrained").add_subplot()
        check_type("ax", ax, Axes, "plt.gca()")
        figure: Any = ax.get_figure(root=True)
        if figure.get_layout_engine() is None:
            figure.set_layout_engine("constrained")
        with _growing(ax):
            drawing.panel_into(ax, panel)
        if isinstance(title, str):
            drawing.write_title(ax, title)
        elif title and panel.title and not ax.get_title():
            drawing.write_title(ax, style.typeset(panel.title))
        ticks.turn(ax)
        if legend is not False:
            _legend(ax, panel, always=bool(legend))
        figure.get_layout_engine().execute(figure)
        drawing.shrink(ax)
    return ax


def _colours(given: Mapping[str, Any] | None) -> dict[str, str]:
    """Return colours as ``#rrggbb``."""
    for name, colour in (given or {}).items():
        if not is_color_like(colour):
            raise InputError(f"colors: {name} must have a colour of matplotlib, got {colour!r}")
    return {name: to_hex(colour) for name, colour in (given or {}).items()}


def _panel(
    result: Any,  # noqa: ANN401
    layer: str | None,
    colormap: str | Colormap | None,
    colours: Mapping[str, str],
    names: Mapping[str, str] | None,
) -> Panel:
    """Return one part of a result, by default the first one with axes."""
    # Alone a part has no names that the other parts explain.
    every = () if layer else registry.of_result(result).panels
    layer = layer or next(panel.name for panel in every if not panel.bare)
    chart = registry.of_result(result, layer=layer, colours=colours, names=names)
    if colormap is not None:
        chart = drawing.in_colours(chart, colormap)
    return chart.whole(chart.panels[0]) if isinstance(chart, Chart) else chart.panels[0]


def _legend(axes: Axes, panel: Panel, *, always: bool) -> None:
    """Write the legend below the names of the axes, as wide as the axes."""
    figure: Any = axes.get_figure(root=True)
    figure.get_layout_engine().execute(figure)
    named, before = marks.legend(panel.marks), axes.get_legend()
    if before is not None:
        texts = [text.get_text().replace("\n", " ") for text in before.get_texts()]
        named = dict(zip(texts, before.legend_handles, strict=True)) | named
    if not named:
        return
    texts, columns = marks.shape([*named], axes.bbox.width / figure.dpi)
    names = axes.xaxis.get_tightbbox()
    below = (axes.bbox.y0 - names.y0 if names else 0.0) / figure.dpi + 0.05
    down = ScaledTranslation(0.0, -below, figure.dpi_scale_trans)
    look: dict[str, Any] = marks.LEGEND | {"ncols": columns, "loc": "upper left"}
    look |= {"bbox_to_anchor": (0.0, 0.0), "bbox_transform": axes.transAxes + down}
    legend = axes.legend([*named.values()], texts, borderaxespad=0.0, frameon=False, **look)
    if not always and legend.get_window_extent().height > axes.bbox.height / 2:
        legend.remove()


@contextlib.contextmanager
def _growing(axes: Axes) -> Iterator[None]:
    """Let axes that show something keep the names of their sides; their limits grow."""
    sides = {"x": axes.xaxis, "y": axes.yaxis} if axes.has_data() else {}
    before = {
        which: (getattr(axes, f"get_{which}lim")(), axis.get_label_text())
        for which, axis in sides.items()
    }
    yield
    for which, (ends, name) in before.items():
        both = (*ends, *getattr(axes, f"get_{which}lim")())
        getattr(axes, f"set_{which}lim")(min(both), max(both))
        sides[which].set_label_text(name or sides[which].get_label_text())
