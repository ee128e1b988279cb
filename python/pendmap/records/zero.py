"""Where the reading is zero: a gauge that is turned round, a rest that is not at 0."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.swings import after_turns, swings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]

__all__ = ["middle_of", "turn_to_rest"]

FAR: Final = 0.15
"""Radians from 0 at which no pendulum rests for friction alone (Tr/w0^2 is 0.002 to 0.02): the
gauge has its zero elsewhere. Less is left to the fit, which estimates the offset."""

QUARTER: Final = 0.1
"""Radians by which a gauge may miss a multiple of 90 degrees and count as turned by it."""

ENOUGH: Final = 10
"""Half cycles about one middle that make it certain."""

STILL: Final = 0.02
"""Share of the whole way that the last tenth of a record stays within at rest."""

CROSSED: Final = 4
"""Half cycles about a rest, without which the end may be held by hand."""

AGREE: Final = 0.1
"""Share of the swing within which the middles of a free swing agree."""


def middle_of(time: Floats, theta: Floats) -> float | None:
    """Return what a free swing ends around, rad: its last quarter's, of whole half cycles."""
    start = time[0] + 0.75 * (time[-1] - time[0])
    late = theta[time >= start]
    if late.size < 20:
        return None
    middle = (float(np.quantile(late, 0.02)) + float(np.quantile(late, 0.98))) / 2
    swing = float(np.quantile(late, 0.98) - np.quantile(late, 0.02)) / 2
    return middle if swing < math.pi else None


def turn_to_rest(work: Work) -> None:
    """Take a zero that is far from the rest to it; the rest is where a free pendulum ends."""
    good = work.trusted
    middle = middle_of(work.time[good], work.theta[good])
    if middle is None:
        return
    # Whole turns are the pendulum's own: it went over the top before.
    turns = 2 * math.pi * round(middle / (2 * math.pi))
    off = middle - turns
    if abs(off) < FAR:
        return
    if not _certain(work.time[good], work.theta[good] - middle):
        text = "too few whole swings to tell what it swings about: the zero is left to the fit"
        work.say("zero-uncertain", text)
        return
    if "angle" in work.declared and abs(off) < math.pi / 2 - QUARTER:
        work.say("zero-offset", f"it swings about {off:.4g} rad: the zero that is given is off")
        return
    quarters = round(off / (math.pi / 2))
    gauge = quarters * math.pi / 2
    if quarters and abs(off - gauge) < QUARTER:
        work.theta -= turns + gauge
        text = f"the gauge is turned by {90 * quarters} degrees: it swings about {off:.4g} rad"
        work.say("gauge-turned", f"{text}, turned back", mended=True)
        return
    work.theta -= turns + off
    text = f"it swings about {off:.4g} rad, the rest is elsewhere than the zero: taken off"
    work.say("zero-offset", text, mended=True)


def _certain(time: Floats, theta: Floats) -> bool:
    """Whether a free swing is seen to have its middle at 0: at its rest, or by many swings."""
    start = after_turns(theta)
    time, theta = time[start:], theta[start:]
    if theta.size < 20:
        return False
    reach = float(np.max(np.abs(theta)))
    peaks = swings(time, theta, least=STILL * reach).peak
    tail = theta[-max(theta.size // 10, 10) :]
    if float(np.ptp(tail)) < STILL * reach and float(np.abs(tail).max()) < STILL * reach:
        return peaks.size >= CROSSED
    if peaks.size < ENOUGH:
        return False
    peaks = peaks[-2 * ENOUGH :]
    middles = (peaks[:-2] + 2 * peaks[1:-1] + peaks[2:]) / 4
    size = float(np.median(np.abs(peaks)))
    return float(np.median(np.abs(middles))) < AGREE * size
