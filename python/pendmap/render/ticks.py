"""Ticks at round numbers, multiples of pi or powers of ten, and their labels."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.ticker import (
    FixedLocator,
    FuncFormatter,
    Locator,
    LogLocator,
    NullLocator,
    SymmetricalLogLocator,
)

from pendmap.charts import plane
from pendmap.render import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

    from pendmap.charts import chart as charts

CLOSER: Final = 6  # Labels at the left of a panel where matplotlib would have four
STEPS: Final = ((1, 2, 5), (1, 3), (1,))  # Labels of a decade, as many as there is room for


class Ticks(Locator):
    """Locator of the ticks of a chart, or of each second, third, ... of them on a short axis."""

    axis: Any  # matplotlib sets it

    def __init__(self, side: charts.Axis) -> None:
        self._side = side
        self.labels: dict[float, str] = {}

    def __call__(self) -> list[float]:
        """Return the tick places."""
        return self.tick_values(*sorted(self.axis.get_view_interval()))

    def tick_values(self, vmin: float, vmax: float) -> list[float]:
        """Return the tick places between two ends."""
        factor, angle = self._side.factor, self._side.scale == "angle"
        shift, ticks = plane.short_ticks(vmin * factor, vmax * factor, angle=angle)
        zero = next((k for k, tick in enumerate(ticks) if tick[1] == "0"), 0)
        every = -(-len(ticks) // max(_room(self.axis), 2))
        shown = ticks[zero % every :: every]
        self.labels = {(shift + at) / factor: text for at, text in shown}
        return [*self.labels]

    def label(self, at: float, _: int | None = None) -> str:
        """Return the label of a tick."""
        return self.labels.get(float(at), "")


class Powers(LogLocator):
    """Locator of a logarithmic axis: powers of ten, and round numbers between if there is room."""

    def tick_values(self, vmin: float, vmax: float) -> Any:  # noqa: ANN401 (as inherited)
        """Return the tick places between two ends."""
        axis: Any = self.axis
        room = _room(axis) / max(abs(math.log10(vmax / vmin)), 1.0)
        self.set_params(subs=next((some for some in STEPS if len(some) <= room), STEPS[-1]))
        ticks: Any = super().tick_values(vmin, vmax)
        return ticks[(ticks >= vmin) & (ticks <= vmax)]


class Signed(SymmetricalLogLocator):
    """Locator of an axis logarithmic on both sides of 0: 0, and powers of ten with room."""

    def tick_values(self, vmin: float, vmax: float) -> Any:  # noqa: ANN401 (as inherited)
        """Return the tick places between two ends."""
        axis: Any = self.axis
        bent = axis.get_transform().transform
        first, last = bent(np.array([vmin, vmax]))
        least = (last - first) / max(_room(axis), 1)
        places: list[float] = []
        ticks = [float(at) for at in super().tick_values(vmin, vmax) if vmin <= at <= vmax]
        for at in sorted(ticks, key=lambda at: (at != 0.0, -abs(at))):
            if all(abs(bent(at) - bent(other)) >= least for other in places):
                places.append(at)
        return np.array(places)


def _room(axis: Any) -> int:  # noqa: ANN401 (an axis of matplotlib)
    """Return how many labels an axis has room for; on the left they may be half a line apart."""
    space = int(axis.get_tick_space())
    return CLOSER * space // 4 if axis.axis_name == "y" else space


def _power(at: float, _: int) -> str:
    return plane.power(float(at))


def scale(axes: Axes, which: str, side: charts.Axis) -> None:
    """Set scale, limits, labels and name of a side of a panel."""
    axis: Axis = getattr(axes, f"{which}axis")
    change = getattr(axes, f"set_{which}scale")
    if side.scale == "log":
        change("log")
    elif side.scale == "signed":
        change("symlog", linthresh=side.straight, linscale=1.0)
    if side.ends is not None:
        getattr(axes, f"set_{which}lim")(*side.ends)
    elif which == "x":
        axes.margins(x=0.0)
    name, (low, high) = side.name, getattr(axes, f"get_{which}lim")()
    if side.ticks is not None:
        axis.set_ticks([at for at, _ in side.ticks], [text for _, text in side.ticks])
    elif side.scale == "log":
        axis.set_major_locator(Powers())
        axis.set_major_formatter(FuncFormatter(_power))
    elif side.scale == "signed":
        axis.set_major_locator(Signed(axis.get_transform()))
        axis.set_major_formatter(FuncFormatter(_power))
    else:
        angle = side.scale == "angle"
        shift, _ = plane.short_ticks(low * side.factor, high * side.factor, angle=angle)
        name, ticks = plane.shifted(name, shift), Ticks(side)
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
