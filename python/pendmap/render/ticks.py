"""Tick labels: as many as fit, at round numbers, multiples of pi or powers of ten."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any, Final

from matplotlib.ticker import Formatter, Locator, NullLocator

from pendmap.charts import plane
from pendmap.render import style

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes

    from pendmap.charts.chart import Axis

LINE: Final = 0.16  # Least distance between stacked labels, inches
CLOSE: Final = 5.0  # Ratio of the ends below which a logarithmic axis has equally spaced labels
LONGEST, BEGINNING = 11, 3  # Letters of a rotated name, and of its part before the ellipsis
NARROW: Final = 20.0
"""Ratio of the ends below which a logarithmic axis has labels between powers of ten."""

Labels = list[tuple[float, str]]


class Ticks(Locator):
    """Locator of the fullest set of labels that fits; it measures the axes at every call."""

    def __init__(self, axes: Axes, which: str, side: Axis) -> None:
        self._axes, self._across, self._side = axes, which == "x", side
        self.labels: dict[float, str] = {}

    def __call__(self) -> list[float]:
        """Return the tick places."""
        axes, across = self._axes, self._across
        low, high = axes.get_xlim() if across else axes.get_ylim()
        every: Labels = next(
            (some for some in _sets(self._side, low, high) if self._fits(some, low, high)), []
        )
        self.labels = dict(every)
        return list(self.labels)

    def tick_values(self, vmin: float, vmax: float) -> Any:  # noqa: ANN401, ARG002 (as inherited)
        """Return the tick places, whatever the limits."""
        return self()

    def _fits(self, labels: Labels, low: float, high: float) -> bool:
        box = self._axes.get_window_extent()
        room = (box.width if self._across else box.height) / self._axes.figure.dpi
        axis = self._axes.xaxis if self._across else self._axes.yaxis
        bent = axis.get_transform().transform
        first, last = (float(bent(end)) for end in (low, high))
        for (a, one), (b, other) in itertools.pairwise(labels):
            apart = abs(float(bent(b)) - float(bent(a))) / abs(last - first) * room
            wide = (style.inches(one) + style.inches(other)) / 2 + 0.1 if self._across else LINE
            if apart < wide:
                return False
        return True


class _Names(Formatter):
    def __init__(self, ticks: Ticks) -> None:
        self._ticks = ticks

    def __call__(self, x: float, pos: int | None = None) -> str:  # noqa: ARG002 (as inherited)
        return self._ticks.labels.get(float(x), "")


def scale(axes: Axes, which: str, side: Axis) -> None:
    """Set scale, limits, labels and name of a side of a panel."""
    axis = axes.xaxis if which == "x" else axes.yaxis
    change = axes.set_xscale if which == "x" else axes.set_yscale
    if side.scale == "log":
        change("log")
    elif side.scale == "signed":
        change("symlog", linthresh=side.straight, linscale=1.0)
    if side.ends is not None:
        (axes.set_xlim if which == "x" else axes.set_ylim)(*side.ends)
    elif which == "x":
        axes.margins(x=0.0)
    ends = axes.get_xlim() if which == "x" else axes.get_ylim()
    name = side.name
    if side.ticks is not None:
        axis.set_ticks([at for at, _ in side.ticks], [text for _, text in side.ticks])
    else:
        if side.scale in ("plain", "angle"):
            low, high = (end * side.factor for end in ends)
            shift, _ = plane.short_ticks(low, high, angle=side.scale == "angle")
            name = plane.shifted(name, shift)
        ticks = Ticks(axes, which, side)
        axis.set_major_locator(ticks)
        axis.set_major_formatter(_Names(ticks))
    axis.set_minor_locator(NullLocator())
    if which == "x":
        axes.set_xlabel(name)
    else:
        axes.set_ylabel(name, labelpad=2)


def _sets(side: Axis, low: float, high: float) -> Iterator[Labels]:
    """Yield sets of labels between two ends, the fullest first."""
    if side.scale == "log":
        yield from ([(at, plane.power(at)) for at in places] for places in powers(low, high))
    elif side.scale == "signed":
        yield from (
            [(at, plane.power(at)) for at in places] for places in signed(side.straight, low, high)
        )
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
