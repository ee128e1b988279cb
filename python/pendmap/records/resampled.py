"""Records with more samples than were measured: drawn out by holding, straight lines or cubics.

Between two readings such a record is a polynomial of low degree, so its differences of the next
order vanish there, at the same places within every interval; those that span a reading do not.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted
from pendmap.records.local_fits import FARTHEST
from pendmap.records.noise import DITHERED, fastest
from pendmap.records.resolution import step_of
from pendmap.signal.local_polynomial import local_fit
from pendmap.signal.robust import normal_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]

ORDERS: Final = {"held": 1, "straight lines": 2, "cubics": 4}
"""The difference that vanishes between readings, by how the samples between were made."""

QUIET: Final = 0.1
"""Differences between readings over those across them: rounding leaves a hundredth, chance 0.8."""

FEWEST: Final = 200
"""Samples of a record in which this is looked for."""

BLOCKS: Final = 60
"""Intervals between readings that are looked at; ten are the least."""

SLOWEST: Final = 5.0
"""Readings a period at least: with fewer the places within an interval are phases of the swing."""

SMOOTH: Final = 0.3
"""Noise between neighbours over the most at any spacing, below which samples were drawn between
readings; a sensor's own smoothness leaves more, and each of its samples tells something."""

GROWN: Final = 0.7
"""Noise over the most at any spacing from which readings count as independent."""

LEAST: Final = 3e-6
"""Noise over the whole way below which it is that of digits, which nothing is judged by."""

FOLLOWED: Final = 1.3
"""What a quartic leaves over what a sextic leaves of noise, at most; of motion it is more."""

_EVEN: Final = 1e-3


@dataclasses.dataclass(frozen=True)
class Resampled:
    """What was measured of a record.

    Parameters
    ----------
    made : str
        How the samples between were made: ``held``, ``straight lines`` or ``cubics``; empty where
        only the noise shows that neighbours are not independent.
    ratio : int
        Samples a reading.
    places : array of int
        Where the readings are.
    """

    made: str
    ratio: int
    places: NDArray[np.intp]


def measured(time: Floats, theta: Floats) -> Resampled | None:
    """Return where the readings of a record are, if most samples are drawn between them.

    Parameters
    ----------
    time, theta : array, shape (N,)
        s, increasing, and rad.

    Returns
    -------
    Resampled or None
        ``None`` where every sample may be a reading: uneven times, no whole number of samples a
        reading, or differences that are alike everywhere.
    """
    if theta.size < FEWEST or np.ptp(theta) == 0:
        return None
    steps = np.diff(time)
    interval = float(np.median(steps))
    if np.max(np.abs(steps / interval - 1)) > _EVEN:
        return None
    quickest = fastest(time, theta, 0.005 * float(np.ptp(theta)))[0]
    most = int(min(math.tau / (SLOWEST * quickest * interval), theta.size / 20))
    begin = int(np.argmax(np.abs(theta - theta[0]) > 0.05 * np.ptp(theta)))
    for made, order in ORDERS.items():
        # Of a ratio the divisors show it as well: the largest one counts.
        for ratio in range(most, order, -1):
            if _share(theta[begin:], ratio, order)[0] < QUIET:
                share, first = _share(theta, ratio, order, blocks=theta.size)
                if share < QUIET:
                    return Resampled(made, ratio, np.arange(first, theta.size, ratio))
    stride = _independent(time[begin:], theta[begin:], FARTHEST / (quickest * interval))
    return Resampled("", stride, np.arange(0, theta.size, stride)) if stride > 1 else None


def _share(theta: Floats, ratio: int, order: int, blocks: int = BLOCKS) -> tuple[float, int]:
    """The difference within an interval over the largest; the place of the reading."""
    stride = ratio // (order + 1)
    change = theta[: blocks * ratio + order * stride]
    for _ in range(order):
        change = change[stride:] - change[:-stride]
    count = change.size // ratio
    if count < 10:
        return 1.0, 0
    sizes = np.abs(change[: count * ratio]).reshape(count, ratio).mean(axis=0)
    # Of a held reading the last sample is no longer alike the next.
    alike = ratio - order * stride + (0 if order == 1 else 1)
    around = np.concatenate((sizes, sizes[: alike - 1]))
    within = np.lib.stride_tricks.sliding_window_view(around, alike).max(axis=1)
    first, largest = int(np.argmin(within)), float(sizes.max())
    return (float(within[first]) / largest if largest > 0 else 1.0), first


def _independent(time: Floats, theta: Floats, farthest: float) -> int:
    """The spacing from which the noise no longer grows, in samples; 1 if it does not grow."""
    strides = [1 << k for k in range(12) if 1 << k <= min(farthest, theta.size / FEWEST)]
    noise, whole = [], []
    for stride in strides:
        part = slice(0, max(10, 2 * stride) * FEWEST)
        t, x = time[part], theta[part]
        low, high = (
            normal_scale(local_fit(t, x, degree=degree, points=points, stride=stride).residual)
            for degree, points in ((4, 9), (6, 11))
        )  # fmt: skip
        # What a quartic leaves and a sextic follows is motion.
        noise.append(high if low < FOLLOWED * high else 0.0)
        whole.append(high)
    most = max(noise, default=0.0)
    count = step_of(theta)
    if most <= max(DITHERED * count, LEAST * float(np.ptp(theta))) or whole[0] > SMOOTH * most:
        return 1
    return strides[next((k for k, one in enumerate(noise) if one > GROWN * most), 0)]


def check(work: Work) -> None:
    """Keep the readings of a record with samples drawn between them, and say so."""
    found = measured(work.time, work.theta)
    if found is None or not found.made:
        return
    samples = work.time.size
    rate = (samples - 1) / float(work.time[-1] - work.time[0])
    how = "each held" if found.made == "held" else f"{found.made} between"
    text = f"the record repeats {_hertz(rate / found.ratio)} at {_hertz(rate)}, {how}"
    if work.pivot() is not None:
        # The pivot may have been read at every sample.
        work.say("interpolated", f"{text}: errors that count samples are too small")
        return
    work.keep(found.places)
    kept = counted(found.places.size, "reading")
    work.say("interpolated", f"{text}: {kept} kept of {samples} samples", mended=True)


def _hertz(rate: float) -> str:
    return f"{rate / 1000:.4g} kHz" if rate >= 1000 else f"{rate:.4g} Hz"
