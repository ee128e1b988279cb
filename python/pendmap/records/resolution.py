"""Whether the readings of a run are enough: for the drive, for the sensor's gain, for a fit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted
from pendmap.records.scale import gain_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]


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


# The step that a sensor's readings come in, and what it does to the noise of a mean.


LATTICE: Final = 0.12
"""Root mean square distance from multiples of a step, in steps, that shows it; 0.29 is chance."""


def step_of(theta: Floats) -> float:
    """Return the step that readings come in, rad; 0 where there is none to be seen.

    The least distance between different readings is tried, then refined by all of them; a step is
    believed where the readings repeat and lie on its multiples.
    """
    values = np.unique(np.round(theta, 12))
    if values.size < 3 or values.size > 0.7 * theta.size:
        return 0.0
    apart = np.diff(values)
    # Written digits round multiples of a step: neighbours differ by it, give or take a digit.
    least = float(np.quantile(apart, 0.02))
    near = apart[(apart >= 0.5 * least) & (apart < 1.5 * least)]
    step = float(np.median(near)) if near.size else least
    multiples = np.round(apart / step)
    small = multiples < 50
    if step <= 0 or not np.any(multiples[small] > 0):
        return 0.0
    step = float(np.sum(apart[small]) / max(np.sum(multiples[small]), 1.0))
    away = (values - values[0]) / step
    away = away - np.round(away)
    phase = np.angle(np.mean(np.exp(2j * np.pi * away))) / (2 * np.pi)
    away = away - phase
    away -= np.round(away)
    return step if float(np.sqrt(np.mean(away**2))) < LATTICE else 0.0


def levels_shared(theta: Floats, step: float) -> float:
    """Return how much larger the noise of a mean is because readings share their step.

    Readings on one step have one error: three independent ones are counted for each step that is
    seen.
    """
    levels = np.unique(np.round(theta / step)).size
    return math.sqrt(max(theta.size / (3 * max(levels, 1)), 1.0))


# The noise of a sensor that shows a few counts of one angle.
#
# At rest a sensor whose noise is less than a count goes to and fro between two or three. How often
# it
# shows each depends on where between two edges the angle is, ``x``, and on the noise ``s`` before
# the
# rounding: ``P_k = Phi((k + 1/2 - x) / s) - Phi((k - 1/2 - x) / s)``, in counts. The root mean
# square
# of such readings is anything from 0 to half a count. Three counts tell ``x`` and ``s``; two leave
# a
# range of both, over which is averaged, all ``x`` and all ``log s`` being as likely before.


SPREADS: Final = np.geomspace(0.02, 1.0, 80)
"""Noise before the rounding that is tried, in counts; beyond, readings are as those of a value."""

PLACES: Final = (np.arange(200) + 0.5) / 200 - 0.5
"""Places of the angle between the edges of its count."""

MOST: Final = 9
"""Counts that are shown at most."""

PARTS: Final = 4
"""Parts of a record whose means agree where nothing moves."""

SURE: Final = 4.0
"""Standard errors by which they may differ."""


def still_noise(theta: NDArray[np.float64], count: float) -> tuple[float, float] | None:
    """Return the noise of readings of one angle, the rounding included, and its standard error.

    Parameters
    ----------
    theta : ndarray of float, shape (N,)
        Readings, rad.
    count : float
        The step of the readings, rad.

    Returns
    -------
    tuple of float, or None
        Both in rad: mean and standard deviation of ``sqrt(s^2 + count^2 / 12)``. None where one
        count alone is shown, or something moves.
    """
    from scipy.special import log_ndtr, logsumexp, ndtr

    steps = np.rint((theta - np.median(theta)) / count).astype(int)
    low, high = int(steps.min()), int(steps.max())
    if low == high or high - low >= MOST:
        return None
    error = float(np.std(steps)) * math.sqrt(PARTS / steps.size)
    means = [float(np.mean(part)) for part in np.array_split(steps, PARTS)]
    if max(means) - min(means) > 2 * SURE * error:
        return None
    shown = np.bincount(steps - low)
    centre = int(np.argmax(shown)) + low
    # Above the middle of a count the far tail is the smaller: digits are kept there.
    level = np.arange(low, high + 1)[:, None, None] - centre - PLACES[None, :, None]
    far, near = (np.abs(level) + side for side in (0.5, -0.5))
    spread = SPREADS[None, None, :]
    tail = log_ndtr(-near / spread) + np.log1p(
        -np.exp(np.minimum(log_ndtr(-far / spread) - log_ndtr(-near / spread), -1e-12))
    )
    inside = np.log(np.maximum(1 - ndtr(near / spread) - ndtr(-far / spread), 1e-300))
    likelihood = np.tensordot(shown, np.where(near > 0, tail, inside), axes=1)
    weight = np.exp(logsumexp(likelihood, axis=0) - logsumexp(likelihood))
    sigma = np.sqrt(SPREADS**2 + 1 / 12)
    mean = float(weight @ sigma)
    return count * mean, count * math.sqrt(float(weight @ (sigma - mean) ** 2))
