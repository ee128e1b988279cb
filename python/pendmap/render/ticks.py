"""Tick labels: as many as fit, at round numbers, multiples of pi or powers of ten."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any, Final

from matplotlib.ticker import FuncFormatter, Locator, NullLocator

from pendmap.charts import plane
from pendmap.render import style

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

    from pendmap.charts import chart as charts

LINE: Final = 0.16  # Least distance between stacked labels, inches
CLOSE: Final = 5.0  # Ratio of the ends below which a logarithmic axis has equally spaced labels
LONGEST, BEGINNING = 11, 3  # Letters of a rotated name, and of its part before the ellipsis
NARROW: Final = 20.0
"""Ratio of the ends below which a logarithmic axis has labels between powers of ten."""

Labels = list[tuple[float, str]]


class Ticks(Locator):
    """Locator of the fullest set of labels that fits; it measures the axes at every call."""

    axis: Any  # matplotlib sets it

    def __init__(self, side: charts.Axis) -> None:
        self._side = side
        self.labels: dict[float, str] = {}

    def __call__(self) -> list[float]:
        """Return the tick places."""
        low, high = self.axis.get_view_interval()
        sets = _sets(self._side, low, high)
        self.labels = dict(next((some for some in sets if self._fits(some, low, high)), []))
        return list(self.labels)

    def tick_values(self, vmin: float, vmax: float) -> Any:  # noqa: ANN401, ARG002 (as inherited)
        """Return the tick places, whatever the limits."""
        return self()

    def _fits(self, labels: Labels, low: float, high: float) -> bool:
        box, across = self.axis.axes.get_window_extent(), self.axis.axis_name == "x"
        room = (box.width if across else box.height) / self.axis.axes.figure.dpi
        bent = self.axis.get_transform().transform
        first, last = (float(bent(end)) for end in (low, high))
        for (a, one), (b, other) in itertools.pairwise(labels):
            apart = abs(float(bent(b)) - float(bent(a))) / abs(last - first) * room
            wide = (style.inches(one) + style.inches(other)) / 2 + 0.1 if across else LINE
            if apart < wide:
                return False
        return True


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
    name = side.name
    if side.ticks is not None:
        axis.set_ticks([at for at, _ in side.ticks], [text for _, text in side.ticks])
    else:
        if side.scale in ("plain", "angle"):
            low, high = (end * side.factor for end in getattr(axes, f"get_{which}lim")())
            shift, _ = plane.short_ticks(low, high, angle=side.scale == "angle")
            name = plane.shifted(name, shift)
        ticks = Ticks(side)
        axis.set_major_locator(ticks)
        axis.set_major_formatter(FuncFormatter(lambda at, _: ticks.labels.get(float(at), "")))
    axis.set_minor_locator(NullLocator())
    axis.set_label_text(style.typeset(name))
    if which == "y":
        axis.labelpad = 2


def _sets(side: charts.Axis, low: float, high: float) -> Iterator[Labels]:
    """Yield sets of labels between two ends, the fullest first."""
    if side.scale in ("log", "signed"):
        straight = side.straight
        sets = powers(low, high) if side.scale == "log" else signed(straight, low, high)
        yield from ([(at, plane.power(at)) for at in places] for places in sets)
    else:
        factor = side.factor
        shift, ticks = plane.short_ticks(low * factor, high * factor, angle=side.scale == "angle")
        zero = next((k for k, tick in enumerate(ticks) if tick[1] == "0"), 0)
        for every in range(1, len(ticks) + 1):
            yield [((shift + at) / factor, text) for at, text in ticks[zero % every :: every]]


def powers(low: float, high: float) -> Iterator[list[float]]:
    """Yield sets of round numbers for a logarithmic axis, the fullest first."""
    tens = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    if high < CLOSE * low:
        ticks = [at for at, _ in plane.plain_ticks(low, high) if low <= at <= high]
        yield ticks
        yield ticks[::2]
    wanted: Sequence[tuple[int, ...]] = ((1, 3), (1,))
    for steps in ((1, 2, 3, 5), (1, 2, 5), *wanted) if high < NARROW * low else wanted:
        ticks = [m * 10.0**k for k in tens for m in steps]
        yield [tick for tick in ticks if low <= tick <= high]
    for every in range(2, len(tens) + 1):
        yield [10.0**k for k in tens if k % every == 0 and low <= 10.0**k <= high]


def signed(inner: float, low: float, high: float) -> Iterator[list[float]]:
    """Yield sets of round numbers on both sides of 0, from ``inner`` outward."""
    first, last = round(math.log10(inner)), math.floor(math.log10(max(-low, high)))
    for steps, every in (((1, 2, 5), 1), ((1, 3), 1), *(((1,), k) for k in range(1, 40))):
        # From the largest down, so that the extent of the axis is labelled.
        sizes = sorted(m * 10.0**k for k in range(last, first - 1, -every) for m in steps)
        ticks = [*(-size for size in reversed(sizes)), 0.0, *sizes]
        yield [tick for tick in ticks if low <= tick <= high]


def turn(axes: Axes) -> None:
    """Write names below a panel horizontally if they fit, else on two lines, or rotated."""
    places, texts = list(axes.get_xticks()), [one.get_text() for one in axes.get_xticklabels()]
    if len(texts) < 2 or isinstance(axes.xaxis.get_major_locator(), Ticks):  # noqa: PLR2004
        return
    low, high = axes.get_xlim()
    room = axes.get_window_extent().width / axes.figure.dpi / abs(high - low)
    for level in (texts, [_folded(text) for text in texts]):
        if max(style.inches(line) for text in level for line in text.split("\n")) + 0.1 <= room:
            axes.set_xticks(places, level)
            return
    axes.set_xticks(places, [short(text) for text in texts], rotation=45, ha="right")


def short(name: str) -> str:
    """Return a name of at most ``LONGEST`` letters that keeps its end, often a run number."""
    if len(name) <= LONGEST:
        return name
    return f"{name[:BEGINNING]}\N{HORIZONTAL ELLIPSIS}{name[BEGINNING + 1 - LONGEST :]}"


def _folded(name: str) -> str:
    """Return a name on two lines, divided after the separator nearest to its middle."""
    marks = [k for k, letter in enumerate(name[:-1], start=1) if letter in "_- ."]
    at = min(marks, key=lambda k: abs(2 * k - len(name)), default=0)
    return f"{name[:at]}\n{name[at:]}" if at else name
