"""Peaks and zero crossings of a free decay with errors, and the natural frequency by peaks."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ellipe, ellipk, ellipkm1

from pendmap.errors import InputError
from pendmap.identification.peak_finder import Finder
from pendmap.identification.readings import FEWEST_A_PERIOD, reading_of
from pendmap.identification.turning import outline, samples_per_period
from pendmap.identification.uncertainty import chain_covariance, chain_least_squares
from pendmap.records.samples import measured
from pendmap.signal.robust import from_first

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from pendmap.identification.turning import End
    from pendmap.signal import Floats, Mask


@dataclasses.dataclass(frozen=True)
class Peaks:
    """Turning points of a free decay, and the zero crossings between them.

    Half cycle ``k`` extends from peak ``k`` to peak ``k + 1``; it is odd if ``k`` is. Peak 0 is the
    release if the record includes it, or else the first turning point.

    Parameters
    ----------
    time : array, shape (P,)
        Times, s.
    amplitude : array, shape (P,)
        Recorded angle with its sign, rad.
    stderr_time, stderr_amplitude : array, shape (P,)
        Standard errors, s and rad; infinite if unknown (amplitude of a clipped peak).
    index : array of int, shape (P,)
        Number ``k`` of the peak; numbers are missing at gaps of the record.
    kind : tuple of str
        ``release``, ``turn`` or ``clipped``.
    crossing_time, crossing_stderr : array, shape (C,)
        Times of the crossings and their standard errors, s.
    crossing_index : array of int, shape (C,)
        Number of the half cycle of each crossing.
    sigma : float
        Standard deviation of a sample's noise from which errors are computed, rad.
    lacking : str
        Reason why peaks cannot be found in a record; empty otherwise.
    """

    time: Floats
    amplitude: Floats
    stderr_time: Floats
    stderr_amplitude: Floats
    index: NDArray[np.int64]
    kind: tuple[str, ...]
    crossing_time: Floats = dataclasses.field(default_factory=lambda: np.empty(0))
    crossing_stderr: Floats = dataclasses.field(default_factory=lambda: np.empty(0))
    crossing_index: NDArray[np.int64] = dataclasses.field(
        default_factory=lambda: np.empty(0, np.int64)
    )
    sigma: float = 0.0
    lacking: str = ""

    @classmethod
    def of(cls, time: ArrayLike, amplitude: ArrayLike) -> Peaks:
        """Return peaks of given times and amplitudes; absolute values get alternating signs."""
        t, a = np.asarray(time, float), np.asarray(amplitude, float)
        if t.ndim != 1 or t.shape != a.shape:
            raise InputError(
                f"times and peaks must be as many, got {t.shape} times of {a.shape} peaks"
            )
        if a.size > 1 and np.all(a[:-1] > 0):
            a = a * (-1.0) ** np.arange(a.size)
        none = np.zeros(t.size)
        return cls(t, a, none, none, np.arange(t.size), ("turn",) * t.size)

    def __len__(self) -> int:
        return self.time.size

    @property
    def known(self) -> bool:
        """Whether the standard errors are known."""
        return bool(np.any(self.stderr_time > 0) or np.any(self.stderr_amplitude > 0))

    @property
    def odd(self) -> Mask:
        """Mask of peaks that begin an odd half cycle, shape (P,)."""
        return np.asarray(self.index % 2 == 1)

    @property
    def turned(self) -> Peaks:
        """Releases and turning points, without clipped peaks."""
        return self.select(np.array([kind != "clipped" for kind in self.kind], bool))

    def later(self, seconds: float) -> Peaks:
        """Return the peaks with all times shifted by ``seconds``."""
        return dataclasses.replace(
            self, time=self.time + seconds, crossing_time=self.crossing_time + seconds
        )

    def select(self, which: Mask) -> Peaks:
        """Return the selected peaks, with all crossings."""
        names = ("time", "amplitude", "stderr_time", "stderr_amplitude", "index")
        some = {name: getattr(self, name)[which] for name in names}
        kind = tuple(k for k, keep in zip(self.kind, which, strict=True) if keep)
        return dataclasses.replace(self, **some, kind=kind)


def find_peaks(
    time: ArrayLike,
    theta: ArrayLike,
    *,
    sigma: float | None = None,
    trusted: ArrayLike | None = None,
) -> Peaks:
    """Find the peaks and zero crossings of a free decay.

    A quartic is fitted by least squares around each peak, a cubic around each crossing. The
    quartic neglects the sixth derivative ``d6 = w0^6 sin A (3 sin^2 A - cos^2 A)`` at a peak ``A``,
    which shifts the amplitude by ``5/231 d6 h^6 / 720`` for a window of half-width ``h``. The width
    is chosen so that this is a quarter of the standard error, and at most 1.3 rad of phase. Coulomb
    friction makes the curvature differ on both sides of a peak, which delays its estimated time by
    ``5/32 h theta_r / sin A``: this is subtracted, with ``theta_r`` estimated from the amplitudes,
    and a fifth of it is added to the error. The mean excess of the maximum of a noisy curve,
    ``stderr(v)^2 / (2 abs(theta''))``, is subtracted from amplitudes.

    Parameters
    ----------
    time, theta : array, shape (N,)
        Times, s, increasing, and angles from the downward rest, rad, unwrapped.
    sigma : float, optional
        Standard deviation of the noise, rad; by default estimated without a model.
    trusted : array of bool, shape (N,), optional
        Samples that may be used; by default all.

    Returns
    -------
    Peaks
        Empty if the record does not swing, or has fewer than 20 samples per period of small swings.

    Raises
    ------
    InputError
        If the arrays do not match, are not finite or time does not increase.

    Notes
    -----
    If the count is coarser than the noise, neighbouring samples have a common error, and standard
    errors are computed with three independent samples per count in the window. Interpolated samples
    between readings are not used.
    """
    t, x = np.asarray(time, float), np.asarray(theta, float)
    good = np.ones(t.shape, bool) if trusted is None else np.asarray(trusted, bool)
    if t.ndim != 1 or t.shape != x.shape or t.shape != good.shape:
        raise InputError(
            f"time, theta, trusted must be rows, got {t.shape}, {x.shape}, {good.shape}"
        )
    (t, first), x = from_first(t[good]), x[good]
    if not (np.isfinite(t).all() and np.isfinite(x).all()):
        raise InputError("time and theta must be finite numbers where trusted, one is not")
    if np.any(np.diff(t) <= 0):
        raise InputError("time must increase, it does not")
    drawn = measured(t, x)
    if drawn is not None:
        _, _, places = drawn
        t, x = t[places], x[places]
    reading = reading_of(t, x, sigma)
    none = dataclasses.replace(Peaks.of((), ()), sigma=reading.sigma)
    count = samples_per_period(t, x)
    if count < FEWEST_A_PERIOD:
        few = f"{count:.3g} samples a period, {FEWEST_A_PERIOD:.3g} are needed for peaks"
        return dataclasses.replace(none, lacking=few)
    course = outline(t, x, reading.sigma)
    if course is None:
        return none
    finder = Finder(t, x, reading, course)
    ends = finder.ends
    index = _numbered(ends, finder.w0)
    columns = np.array([(e.time, e.angle, e.stderr_time, e.stderr_angle) for e in ends])
    instant, angle, stderr_time, stderr_angle = columns.reshape(-1, 4).T.copy()
    kind, crossings = tuple(e.kind for e in ends), finder.crossings(index)
    peaks = Peaks(
        instant, angle, stderr_time, stderr_angle, index, kind, *crossings, sigma=reading.sigma
    )
    return peaks.later(first)


def _numbered(ends: list[End], w0: float) -> NDArray[np.int64]:
    """Return the numbers of the peaks, consistent with alternating signs and the half period."""
    result = [0] if ends else []
    for before, after in itertools.pairwise(ends):
        mean = min((abs(before.angle) + abs(after.angle)) / 2, 3.1)
        half = 2 * float(ellipk(math.sin(mean / 2) ** 2)) / w0
        cycles = (after.time - before.time) / half
        odd = before.angle * after.angle < 0
        steps = 2 * round((cycles - 1) / 2) + 1 if odd else 2 * round(cycles / 2)
        result.append(result[-1] + max(steps, 1))
    return np.array(result, np.int64)


@dataclasses.dataclass(frozen=True)
class Frequency:
    """Natural frequency ``w0`` (rad/s), its standard error, and chi^2 per degree of freedom.

    The error is multiplied by the square root of the misfit if that is above 1.
    """

    w0: float
    stderr: float
    misfit: float


def mean_period(time: Floats) -> float:
    """Return the mean of all overlapping ``t[i + 2] - t[i]``, s, the paper's average period."""
    return float(np.mean(time[2:] - time[:-2]))


def quarters(amplitude: Floats) -> tuple[Floats, Floats]:
    """Return the phase ``w0 t = K(sin^2(A/2))`` of a quarter swing, and its derivative by ``A``."""
    size = np.clip(np.abs(amplitude), 1e-6, math.pi - 1e-6)
    m, rest = np.sin(size / 2) ** 2, np.cos(size / 2) ** 2
    quarter = ellipkm1(rest)
    return quarter, (ellipe(m) - rest * quarter) / (2 * m * rest) * np.sin(size) / 2


def frequency(peaks: Peaks, *, zeta: float = 0.0, offset: float = 0.0) -> Frequency:
    """Fit the amplitude-corrected period ``T = 4 K(m) / w0``, ``m = sin^2(A/2)``, to all peaks.

    A half cycle between the peaks ``A`` and ``B`` takes a quarter period of each, ``w0 t =
    [K(sin^2(A/2)) + K(sin^2(B/2))] / sqrt(1 - zeta^2)``. For viscous damping and friction this is
    correct to first order; at ``zeta = 0.004`` its error is 3e-4 of the half cycle near 2.6 rad and
    5e-5 near 2 rad. Weights include errors of times and amplitudes and their correlation between
    neighbouring half cycles. Half cycles next to a missing peak are excluded. ``offset`` is the
    zero error, rad.
    """
    amplitude = peaks.amplitude - offset
    quarter, slope = quarters(amplitude)
    time = peaks.time
    pairs = np.flatnonzero(np.diff(peaks.index) == 1)
    if pairs.size == 0:
        raise ValueError("no two peaks follow one another")
    lasts, both = time[pairs + 1] - time[pairs], quarter[pairs + 1] + quarter[pairs]
    rough = float(np.median(lasts / both))
    one = np.ones(pairs.size)
    # An error of a time changes two half cycles oppositely, one of an amplitude alike.
    late = chain_covariance(pairs, -one, one, np.maximum(peaks.stderr_time, 1e-12) ** 2)
    wide = chain_covariance(
        pairs, slope[pairs] * rough, slope[pairs + 1] * rough, peaks.stderr_amplitude**2
    )
    values, covariance, misfit = chain_least_squares(both[:, None], lasts, late + wide)
    root = math.sqrt(1 - zeta**2)
    w0 = 1 / (float(values[0]) * root)
    return Frequency(w0, math.sqrt(float(covariance[0, 0])) * w0**2 * root, misfit)


def viscous_work(amplitude: Floats) -> Floats:
    """Return ``int th'^2 dt / w0`` over a half cycle of a pendulum of this amplitude, rad^2.

    ``8 (E(m) - (1 - m) K(m))``, ``m = sin^2(A/2)``; ``pi A^2 / 2`` for small swings.
    """
    half = np.minimum(np.abs(amplitude), math.pi - 1e-9) / 2
    m, rest = np.sin(half) ** 2, np.cos(half) ** 2
    return np.asarray(8 * (ellipe(m) - rest * ellipkm1(rest)))
