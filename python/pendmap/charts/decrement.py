"""Decrement of each triplet of peaks against amplitude (figure 5), with and without the zero error.

A zero error ``b`` of the angle makes the differences of successive peaks alternate by ``2 b``, and
so the decrements of triplets that begin at odd and at even peaks.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.marks import NONE, QUIET, ZERO, Band, Level, Line, Mark, Points
from pendmap.charts.methods import EVEN, MEASURED, NOISE, NOISE_SAID, ODD, look, nothing
from pendmap.formatting import Estimate, estimate_text, typographic
from pendmap.identification.methods.combined import CUT, triplets
from pendmap.identification.table1 import first_state, simulated_peaks
from pendmap.signal.robust import Z95

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.charts.marks import Floats
    from pendmap.identification import Identification, IdentificationReport, Peaks
    from pendmap.identification.table1 import State
    from pendmap.model import Rig

TITLE: Final = "The decrement δ of each three peaks"
SIZE: Final = "middle peak |θ| (rad)"
REACH: Final = 3.0
"""Range of a signed panel with few triplets, over the 90th percentile of their absolute values."""


@dataclasses.dataclass(frozen=True)
class Triplets:
    """Decrements of three successive peaks (eq. 2.7), with the size of the middle peak in rad."""

    size: Floats
    delta: Floats
    stderr: Floats
    odd: NDArray[np.bool_]


def triplets_of(peaks: Peaks, zero: float = 0.0) -> Triplets:
    """Return the triplets of neighbouring peaks, with a zero error (rad) subtracted from angles."""
    turned = peaks.turned
    size = np.abs(turned.amplitude - zero)
    if size.size < 3:  # noqa: PLR2004
        return Triplets(NONE, NONE, NONE, np.empty(0, bool))
    delta, _ = triplets(size)
    row = turned.index[2:] - turned.index[:-2] == 2  # noqa: PLR2004
    stderr = _stderr(size, turned.stderr_amplitude)
    falling = (size[:-2] > size[1:-1]) & (size[1:-1] > size[2:])
    delta = np.where(falling, delta, np.nan)
    odd = turned.index[:-2] % 2 == 1
    return Triplets(size[1:-1][row], delta[row], stderr[row], odd[row])


def _stderr(size: Floats, error: Floats) -> Floats:
    """Return the standard errors of triplets from those of the absolute peaks."""
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = 1 / (size[:-2] - size[1:-1]), 1 / (size[1:-1] - size[2:])
        parts = (error[:-2] * first, error[1:-1] * (first + second), error[2:] * second)
    return np.asarray(np.sqrt(sum(part**2 for part in parts)) / math.pi)


def part(report: IdentificationReport) -> Chart:
    """Return absolute and signed decrements, as recorded and without the zero error."""
    raw, source = triplets_of(report.peaks), _source(report)
    if not raw.size.size:
        return nothing(TITLE, "Fewer than three peaks in a row.")
    able = [method for method in report.methods.values() if method.applicable]
    zero = next((one.estimates["offset"] for one in able if "offset" in one.estimates), None)
    columns = [("as recorded", "", raw, 0.0 if zero is None else zero.value)]
    if zero is not None:
        error = None if zero.stderr is None else 1e3 * zero.stderr
        removed = typographic(estimate_text(Estimate(1e3 * zero.value, error)))
        without = triplets_of(report.peaks, zero.value)
        columns.append(("zero error removed", f", {removed} mrad removed", without, 0.0))
    known = np.concatenate([some.delta[np.isfinite(some.delta)] for _, _, some, _ in columns])
    level = 0.0 if source is None else abs(_delta(source))
    ends = (max(float(raw.size.min()) / 1.25, 1e-9), float(raw.size.max()) * 1.15)
    sides = (_absolute(known, level), _signed(known, level))
    panels = []
    for text, removed, some, shift in columns:
        lost = int(np.isnan(some.delta).sum())
        count = f": {lost} of {some.delta.size} have none" if lost else ""
        for up, title in zip(sides, (f"|δ|, {text}{count}", f"δ{removed}"), strict=True):
            absolute = up is sides[0]
            across = Axis("" if absolute else SIZE, ends, "log", ticks=() if absolute else None)
            marks = _points(some, up, absolute=absolute)
            if source is not None:
                marks += _model(report.peaks, source, shift, (ends[0], up), absolute=absolute)
            if not absolute:
                marks.append(ZERO)
            panels.append(Panel(f"{up.name} {text}", title, across, up, marks))
    return Chart(TITLE, "", [panels[0::2], panels[1::2]], size=(8.6, 5.0))


def _source(report: IdentificationReport) -> Identification | None:
    """Return the first method with frequency, damping and zero, else the first two, if any."""
    able = [method for method in report.methods.values() if method.applicable]
    for wanted in ({"w0", "c_over_m", "offset"}, {"w0", "c_over_m"}):
        for method in able if not report.table.left_out else ():
            if wanted <= set(method.estimates):
                return method
    return None


def from_first_peak(rig: Rig, peaks: Peaks, zero: float) -> tuple[State, Floats, Floats]:
    """Return the first peak less a zero error, and times and angles of the peaks from it on."""
    start = first_state(peaks)
    begun = dataclasses.replace(start, theta=start.theta - zero)
    return begun, *simulated_peaks(rig, begun, float(peaks.turned.time[-1]))


def _delta(method: Identification) -> float:
    """Return ``zeta / sqrt(1 - zeta^2)`` of an identification."""
    zeta = method["c_over_m"] / (2 * method["w0"])
    return zeta / math.sqrt(max(1 - zeta**2, 1e-12))


def _absolute(known: Floats, level: float) -> Axis:
    sizes = np.abs(known[known != 0])
    everything = np.append(sizes, level) if level else sizes
    if not everything.size:
        everything = np.array([1e-3, 1.0])
    low = max(float(np.percentile(everything, 2)), float(everything.max()) * 1e-4)
    low = min(low, level) if level else low
    return Axis("|δ|", (low / 1.6, float(everything.max()) * 1.6), "log")


def _signed(known: Floats, level: float) -> Axis:
    """Return an axis that contains most of the triplets; those beyond are drawn at its ends."""
    far = float(np.percentile(np.abs(known), 90)) if known.size else 1.0
    far = max(REACH * far if known.size < 10 else 1.35 * far, 4 * level, 1e-6)  # noqa: PLR2004
    return Axis("δ", (-far, far))


def _points(some: Triplets, up: Axis, *, absolute: bool) -> list[Mark]:
    low, high = up.ends or (-math.inf, math.inf)
    value = np.abs(some.delta) if absolute else some.delta
    marks: list[Mark] = []
    for odd, colour, marker in ((False, EVEN, "s"), (True, ODD, "o")):
        which = (some.odd == odd) & np.isfinite(value)
        x, y = some.size[which], value[which]
        inside = (y >= low) & (y <= high)
        look: dict[str, Any] = {"colour": colour, "order": 3.0}
        spots: dict[str, Any] = {"marker": marker, "size": 3.0, "edge_width": 0.8}
        spots |= {"name": f"from an {'odd' if odd else 'even'} peak"} | look
        marks.append(Points(x[inside], y[inside], fill=colour if odd else "#ffffff", **spots))
        for beyond, edge, arrow in ((y > high, high, "^"), (y < low, low, "v")):
            at = np.full(int(beyond.sum()), edge)
            marks.append(Points(x[beyond], at, marker=arrow, size=3.6, clip=False, **look))
    return marks


def _model(
    peaks: Peaks, source: Identification, shift: float, place: tuple[float, Axis], *, absolute: bool
) -> list[Mark]:
    """Return the triplets of simulated peaks with a zero error, and the band of the noise."""
    level, solid = _delta(source), f"{look(source.method).label}, simulated"
    dashed: dict[str, Any] = {"dash": "--", "name": f"its δ = {level:.3g}"}
    marks: list[Mark] = [
        Line(NONE, NONE, colour=MEASURED, width=1.0, name=solid),
        Level(abs(level) if absolute else level, colour=MEASURED, width=1.0, **dashed),
        Level(CUT, axis="x", colour=QUIET, dash=":", name="12°"),
    ]
    turned = peaks.turned
    _, _, angles = from_first_peak(source.rig, peaks, source.zero)
    size = np.abs(angles + shift)
    if size.size < 3:  # noqa: PLR2004
        return marks
    rising = np.argsort(np.abs(turned.amplitude))
    error = np.interp(size, np.abs(turned.amplitude)[rising], turned.stderr_amplitude[rising])
    delta, _ = triplets(size)
    wide = Z95 * _stderr(size, error)
    odd = (np.arange(delta.size) + int(turned.index[0])) % 2 == 1
    least, up = place
    seen = np.isfinite(delta) & (size[1:-1] >= least)
    floor = up.ends[0] if up.ends else -math.inf
    noise = NOISE_SAID if np.any(turned.stderr_amplitude > 0) else ""
    for parity, colour in ((False, EVEN), (True, ODD)):
        which = seen & (odd == parity)
        x, value = size[1:-1][which], np.abs(delta[which]) if absolute else delta[which]
        low, high = np.maximum(value - wide[which], floor), value + wide[which]
        marks.append(Line(x, value, colour=colour, width=1.0, order=2.5))
        marks.append(Band(x, low, high, colour=NOISE, alpha=0.7, order=1.0, name=noise))
    return marks
