"""Whether the readings of a run are enough: for the drive, for the sensor's gain, for a fit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.scale import gain_of
from pendmap.words import counted

if TYPE_CHECKING:
    from pendmap.records.work import Work

__all__ = ["check"]

RESOLVED: Final = 2.0
"""Readings in a period of the drive under which it is taken for a slower one (Nyquist)."""

KNOWN: Final = 0.1
"""Half of the 95 % interval of the gain, from which on sizes in rad are said to be unsure."""

USED: Final = 0.1
"""Share of the readings in motion that a fit uses at least, or it is said before any number."""

RESTING: Final = ("held", "rest")
"""Stretches whose readings are not missed: nothing moves there."""


def check(work: Work) -> None:
    """Say where readings are too few for the drive or a fit, and swings too small for the gain."""
    _few(work)
    _drive(work)
    if work.plan.kind == "free" and work.made_of is None and not work.integrated:
        _gain(work)


def _few(work: Work) -> None:
    moving = np.ones(work.time.size, bool)
    for part in work.segments:
        if part.what in RESTING:
            moving &= (work.time < part.from_s) | (work.time > part.to_s)
    used, whole = int(work.trusted.sum()), int((moving | work.trusted).sum())
    if 0 < used < USED * whole:
        text = (
            f"only {used} of {counted(whole, 'reading')} in motion are for fitting: what is fitted "
            "says little about the others"
        )
        work.say("few-used", text)


def _drive(work: Work) -> None:
    omega = (work.plan.drive or {}).get("Omega")
    if not omega:
        return
    rate = 1 / float(np.median(np.diff(work.time)))
    drive = float(omega) / math.tau
    if rate >= RESOLVED * drive:
        return
    slow = abs(drive - rate * round(drive / rate))
    text = (
        f"the drive of {drive:.4g} Hz is read at {rate:.4g} Hz: {rate / drive:.3g} readings a "
        f"period do not resolve it, {RESOLVED:g} and more would; it looks like one of "
        f"{slow:.3g} Hz"
    )
    work.say("drive-unresolved", text)


def _gain(work: Work) -> None:
    gain = gain_of(work)
    if gain is None:
        return
    low, high = gain
    if high - low <= 2 * KNOWN:
        return
    between = f"{low:.2g} to {high:.2g}" if math.isfinite(high) else f"{low:.2g} or more"
    text = (
        f"swings so small hardly show the gain of the sensor: the readings are {between} times the "
        "angle (95 %), by how the period grows with the swing; friction is as uncertain"
    )
    work.say("gain-unknown", text)
