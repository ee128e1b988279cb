"""One panel of a chart in Axes of one's own."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from matplotlib.transforms import Bbox, ScaledTranslation

from pendmap.charts.chart import Chart, Sheet
from pendmap.charts.marks import Image
from pendmap.render import drawing, marks, regions, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def into(
    axes: Axes, chart: Chart | Sheet, *, title: bool = True, legend: bool | None = None
) -> None:
    """Draw the first panel of a chart into given axes, in their fonts.

    The legend is below the panel; without ``legend`` one higher than half the panel is left out.
    """
    figure: Any = axes.figure
    if figure.get_layout_engine() is not None:
        figure.get_layout_engine().execute(figure)
    room = drawing.inches_of(axes)
    first = chart.panels[0]
    if isinstance(chart, Chart):
        first = chart.whole(first)
    chart = Chart("", "", [[replace(first, note=())]])
    if legend is not False:
        chart = regions.labelled(chart, lambda _: room)
    panel = chart.panels[0]
    drawing.panel_into(axes, panel)
    if title and panel.title:
        long = style.width_of(panel.title) > room[0]
        axes.set_title(style.typeset(style.folded(panel.title, room[0]) if long else panel.title))
    handles, texts = marks.legend(panel.marks)
    images = [mark for mark in panel.marks if isinstance(mark, Image)]
    short = {style.typeset(long): text for image in images for text, long in image.labels}
    texts = [short.get(text, text).replace("\n", ", ") for text in texts]
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
