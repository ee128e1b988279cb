"""Ticks at round numbers, multiples of pi or powers of ten, and their labels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from matplotlib.ticker import FixedLocator, FuncFormatter, Locator, NullLocator

from pendmap.charts import plane
from pendmap.render import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pendmap.charts import chart as charts

CLOSER: Final = 6  # Labels at the left of a panel where matplotlib would have four


class Ticks(Locator):
    """Locator of the ticks of a chart, as many as have room."""

    axis: Any  # matplotlib sets it

    def __init__(self, side: charts.Axis) -> None:
        self._side = side
        self.labels: dict[float, str] = {}

    def __call__(self) -> list[float]:
        """Return the tick places."""
        return self.tick_values(*sorted(self.axis.get_view_interval()))

    def tick_values(self, vmin: float, vmax: float) -> list[float]:
        """Return the tick places between two ends."""
        room = int(self.axis.get_tick_space())
        if self.axis.axis_name == "y":  # labels may be half a line apart
            room = CLOSER * room // 4
        self.labels = dict(plane.ticks(self._side, vmin, vmax, max(room, 2))[1])
        return [*self.labels]

    def label(self, at: float, _: int | None = None) -> str:
        """Return the label of a tick."""
        return self.labels.get(float(at), "")


def scale(axes: Axes, which: str, side: charts.Axis) -> None:
    """Set scale, limits, labels and name of a side of a panel."""
    axis: Any = getattr(axes, f"{which}axis")
    change = getattr(axes, f"set_{which}scale")
    if side.scale == "log":
        change("log")
    elif side.scale == "signed":
        change("symlog", linthresh=side.straight, linscale=1.0)
    if side.ends is not None:
        getattr(axes, f"set_{which}lim")(*side.ends)
    elif which == "x":
        axes.margins(x=0.0)
    name, _ = plane.ticks(side, *sorted(axis.get_view_interval()))
    if side.ticks is not None:
        axis.set_ticks([at for at, _ in side.ticks], [text for _, text in side.ticks])
    else:
        ticks = Ticks(side)
        axis.set_major_locator(ticks)
        axis.set_major_formatter(FuncFormatter(ticks.label))
    axis.set_minor_locator(NullLocator())
    axis.set_label_text(style.typeset(name))
    if which == "y":
        axis.labelpad = 2


def turn(axes: Axes) -> None:
    """Write names below a panel at an angle if they do not fit side by side."""
    texts = [label.get_text() for label in axes.get_xticklabels()]
    if isinstance(axes.xaxis.get_major_locator(), FixedLocator) and texts:
        size, figure = style.points("xtick.labelsize"), axes.get_figure(root=True)
        room = axes.bbox.width / (figure.dpi if figure else 1.0) / len(texts)
        if max(style.inches(text, size) for text in texts) + 0.15 > room:
            axes.tick_params("x", rotation=45)
            for label in axes.get_xticklabels():
                label.set(ha="right", rotation_mode="anchor")
