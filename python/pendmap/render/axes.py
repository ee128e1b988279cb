"""One panel of a chart in Axes of one's own."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from matplotlib.transforms import Bbox, ScaledTranslation

from pendmap.charts.chart import Chart, Sheet
from pendmap.charts.marks import Image
from pendmap.render import drawing, marks, regions, style

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes

    from pendmap.charts.chart import Panel


def into(
    axes: Axes, chart: Chart | Sheet, *, title: bool = True, legend: bool | None = None
) -> None:
    """Draw the first panel of a chart into given axes, in their fonts.

    The legend is below the panel; without ``legend`` one higher than half the panel is left out.
    Axes that show something already keep their title and their names; limits and legend grow.
    """
    figure: Any = axes.figure
    if figure.get_layout_engine() is not None:
        figure.get_layout_engine().execute(figure)
    room = drawing.inches_of(axes)
    panel = first(chart)
    if legend is not False:
        chart = regions.labelled(Chart("", "", [[panel]]), lambda _: room)
        panel = chart.panels[0]
    before = _named(axes)
    with _growing(axes):
        drawing.panel_into(axes, panel)
    if title and panel.title and not axes.get_title():
        long = style.width_of(panel.title) > room[0]
        axes.set_title(style.typeset(style.folded(panel.title, room[0]) if long else panel.title))
    handles, texts = entries(panel)
    named = before | dict(zip(texts, handles, strict=True))
    handles, texts = [*named.values()], [*named]
    size = style.points("legend.fontsize")
    texts = [style.broken(text, room[0] - drawing.HANDLE, size) for text in texts]
    columns = drawing.columns(texts, room[0])
    lines = sum(text.count("\n") + 1 for text in texts[::columns])
    if not texts or legend is False or (legend is None and drawing.ROW * lines > room[1] / 2):
        return
    down = -3.4 * style.points("font.size") / 72
    below = axes.legend(
        handles,
        texts,
        ncols=columns,
        loc="upper left",
        bbox_to_anchor=(0.0, 0.0),
        bbox_transform=axes.transAxes + ScaledTranslation(0.0, down, figure.dpi_scale_trans),
        borderaxespad=0.0,
        frameon=False,
        handlelength=1.2,
    )
    whole: Any = below.get_tightbbox

    def as_wide_as_the_panel(renderer: Any = None) -> Bbox:  # noqa: ANN401 (of any backend)
        # A layout leaves room below the panel, and does not narrow it.
        box, panel = whole(renderer), axes.bbox
        return Bbox.from_extents(panel.x0, box.y0, panel.x1, box.y1)

    below.get_tightbbox = as_wide_as_the_panel  # type: ignore[method-assign]


def first(chart: Chart | Sheet) -> Panel:
    """Return the first panel of a chart, with its own labels."""
    panel = chart.panels[0]
    return replace(chart.whole(panel) if isinstance(chart, Chart) else panel, note=())


def entries(panel: Panel) -> tuple[list[Any], list[str]]:
    """Return the handles of a panel's legend, and their texts."""
    handles, texts = marks.legend(panel.marks)
    images = [mark for mark in panel.marks if isinstance(mark, Image)]
    short = {style.typeset(long): text for image in images for text, long in image.labels}
    return handles, [short.get(text, text).replace("\n", ", ") for text in texts]


def _named(axes: Axes) -> dict[str, Any]:
    """Return the entries of the legend that axes have."""
    there = axes.get_legend()
    if there is None:
        return {}
    texts = [text.get_text().replace("\n", " ") for text in there.get_texts()]
    return dict(zip(texts, there.legend_handles, strict=True))


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
