"""One panel of a chart in Axes of one's own."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.transforms import Bbox, BboxTransformFrom, BboxTransformTo, ScaledTranslation

from pendmap.charts.chart import Chart, Sheet
from pendmap.charts.marks import Image
from pendmap.render import drawing, marks, regions, style

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes

    from pendmap.charts.chart import Panel
    from pendmap.charts.marks import Ends


def into(
    axes: Axes, chart: Chart | Sheet, *, title: bool = True, legend: bool | None = None
) -> None:
    """Draw the first panel of a chart into given axes, in their fonts.

    The legend is below the panel; without ``legend`` one higher than half the panel is left out.
    Axes that show something already keep their title and their names; limits and legend grow.
    """
    figure: Any = axes.figure
    panel, before = first(chart), _named(axes)
    with _growing(axes):
        drawing.panel_into(axes, panel)
    wide, high = _fitted(axes)
    if title and panel.title and not axes.get_title():
        long = style.width_of(panel.title) > wide
        axes.set_title(style.typeset(style.folded(panel.title, wide) if long else panel.title))
    drawing.turned(axes, panel)
    wide, high = _fitted(axes)
    if legend is not False:
        lines = 0.0
        for _ in range(2):  # the legend takes its height from the panel
            room = (wide, high - lines)
            inside = regions.labelled(Chart("", "", [[panel]]), {panel: room}.__getitem__)
            handles, texts = entries(inside.panels[0])
            named = before | dict(zip(texts, handles, strict=True))
            texts, columns, lines = _broken([*named], wide)
        for mark in inside.panels[0].marks[len(panel.marks) :]:
            marks.draw(axes, mark)
            axes.texts[-1].set_in_layout(False)
    box: Any = axes.get_tightbbox()
    around = box.height - axes.bbox.height
    half = (_place(axes).height - around) / figure.dpi / 2
    if legend is False or not texts or (legend is None and lines > half):
        return
    down = -3.4 * style.points("font.size") / 72
    below = axes.legend(
        [*named.values()],
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
    _fitted(axes)


def _broken(texts: list[str], wide: float) -> tuple[list[str], int, float]:
    """Return texts of a legend in lines that fit, the number of its columns, and its height."""
    size = style.points("legend.fontsize")
    texts = [style.broken(text, wide - drawing.HANDLE, size) for text in texts]
    columns = drawing.columns(texts, wide)
    return texts, columns, drawing.ROW * sum(t.count("\n") + 1 for t in texts[::columns])


def _fitted(axes: Axes) -> Ends:
    """Lay out a figure, make axes smaller whose texts leave their place; return their inches.

    Their place is the figure, or the part of a grid up to the middle of the gaps around it. Their
    colour bar is made smaller with them; upright names longer than it are broken.
    """
    figure: Any = axes.figure
    if figure.get_layout_engine() is not None:
        figure.get_layout_engine().execute(figure)
    drawn = [*axes.images, *axes.collections]
    group: list[Any] = [axes, *(one.colorbar.ax for one in drawn if one.colorbar)]
    place, least = np.asarray(_place(axes).extents), drawing.LEAST * figure.dpi
    for _ in range(3):
        for one in group:
            name, high = one.yaxis.label, drawing.inches_of(one)[1]
            name.set_text(style.broken(name.get_text(), high, name.get_fontsize()))
        box = Bbox.union([one.get_tightbbox() for one in group]).extents
        lack = np.maximum((box - place) * (-1, -1, 1, 1), 0.0) * (1, 1, -1, -1)
        boxes = [one.get_position(original=True) for one in group]
        old = Bbox.union(boxes).transformed(figure.transSubfigure)
        new = Bbox(np.reshape(old.extents + lack, (2, 2)))
        if np.abs(lack).max() < 1 or min(new.width, new.height) < least:
            break
        move = BboxTransformFrom(old) + BboxTransformTo(new)
        for one, own in zip(group, boxes, strict=True):
            moved = own.transformed(figure.transSubfigure).transformed(move)
            one._set_position(moved.transformed(figure.transSubfigure.inverted()))  # noqa: SLF001
    return drawing.inches_of(axes)


def _place(axes: Axes) -> Bbox:
    """Return the part of a figure that axes may fill with their texts, in pixels."""
    figure: Any = axes.figure
    spec = axes.get_subplotspec()
    if spec is None:
        return Bbox(figure.bbox.get_points())
    spec = spec.get_topmost_subplotspec()
    low, high, left, right = spec.get_gridspec().get_grid_positions(figure)
    across = np.concatenate([[0.0], (right[:-1] + left[1:]) / 2, [1.0]])
    up = np.concatenate([[1.0], (low[:-1] + high[1:]) / 2, [0.0]])
    rows, columns = spec.rowspan, spec.colspan
    corners = [[across[columns.start], up[rows.stop]], [across[columns.stop], up[rows.start]]]
    return Bbox(corners).transformed(figure.transSubfigure)


def first(chart: Chart | Sheet) -> Panel:
    """Return the first panel of a chart, with its own labels."""
    panel = chart.panels[0]
    return replace(chart.whole(panel) if isinstance(chart, Chart) else panel, note=())


def entries(panel: Panel) -> tuple[list[Any], list[str]]:
    """Return the handles of a panel's legend, and their texts."""
    handles, texts = marks.legend(panel.marks)
    images = [mark for mark in panel.marks if isinstance(mark, Image)]
    short = {style.typeset(long): text for image in images for text, long in image.labels if text}
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
