"""Combined decrement of viscous damping and Coulomb friction, as printed in the paper.

Horton, Wiercigroch & Xu (2008), Phil. Trans. R. Soc. A, section 2, eqs. 2.4 to 2.10.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from pendmap.identification.methods.base import Identification, identified, inapplicable, too_few
from pendmap.identification.period import mean_period
from pendmap.identification.uncertainty import bootstrap, propagated

if TYPE_CHECKING:
    from pendmap.identification.peaks import Peaks
    from pendmap.signal import Floats


Reading = Literal["all", "odd_ends", "odd_triplets"]  # Interpretations of the peaks to be used

CUT: Final = math.radians(12.0)
"""Amplitude above which peaks are excluded, rad: the pendulum is nonlinear there."""

_FEWEST: Final = 4  # Fewest peaks below the cut
_USES: Final[dict[Reading, str]] = {
    "all": "of them the first two and the last two",
    "odd_ends": "of them the first two and the last two that begin at an odd peak",
    "odd_triplets": "the mean over all triplets that begin at an odd peak",
}
"""Description of the peaks used by each interpretation, for the result."""


@dataclasses.dataclass(frozen=True)
class Decrement:
    """Result of the combined method for a decay of small amplitude."""

    delta: float  # zeta / sqrt(1 - zeta^2), eq. 2.7
    theta_r: float  # Tr / w0^2, rad, eq. 2.10
    mean_period: float  # mean period of all overlapping full cycles, s

    @property
    def zeta(self) -> float:
        """Damping ratio."""
        return self.delta / math.sqrt(1 + self.delta**2)

    @property
    def w0(self) -> float:
        """Natural frequency ``2 pi / (mean_period sqrt(1 - zeta^2))``, rad/s."""
        return 2 * math.pi / (self.mean_period * math.sqrt(1 - self.zeta**2))

    @property
    def Tr(self) -> float:  # noqa: N802 (the paper's name)
        """Coulomb friction over inertia, rad/s^2."""
        return self.w0**2 * self.theta_r

    @property
    def si(self) -> Floats:
        """Array of ``w0, c_over_m, Tr``, SI."""
        return np.array([self.w0, 2 * self.zeta * self.w0, self.Tr])


def recursion(first: float, delta: float, theta_r: float, count: int) -> Floats:
    """Return the absolute values of peaks by eqs. 2.4 to 2.6, shape (count,).

    ``abs(th_k) = -theta_r (E + 1) + E abs(th_{k-1})``, ``E = exp(-delta pi)``. Negative values,
    after the pendulum has stopped, are meaningless.
    """
    shrink = math.exp(-delta * math.pi)
    result = np.empty(count)
    result[0] = first
    for k in range(1, count):
        result[k] = -theta_r * (shrink + 1) + shrink * result[k - 1]
    return result


def decrement(peaks: Floats) -> float:
    """Return ``delta`` by eq. 2.7, from the first two and the last two absolute peaks.

    ``delta = ln[(th_0 - th_1) / (th_{k-1} - th_k)] / ((k - 1) pi)``; the peaks between them cancel.
    NaN if the ratio is not positive.
    """
    ratio = (peaks[0] - peaks[1]) / (peaks[-2] - peaks[-1])
    if not ratio > 0:
        return math.nan
    return float(math.log(ratio) / ((peaks.size - 2) * math.pi))


def coulomb(peaks: Floats) -> float:
    """Return ``theta_r = Tr / w0^2``, rad, by eq. 2.10, from the first and last two peaks."""
    first, second, last_but_one, last = peaks[0], peaks[1], peaks[-2], peaks[-1]
    below = second + first - last_but_one - last
    return float((second * last_but_one - first * last) / below) if below else math.nan


def triplets(peaks: Floats) -> tuple[Floats, Floats]:
    """Return ``delta`` and ``theta_r`` (figure 5) of each three consecutive peaks, (P - 2,)."""
    first, second, third = peaks[:-2], peaks[1:-1], peaks[2:]
    with np.errstate(invalid="ignore", divide="ignore"):
        delta = np.log((first - second) / (second - third)) / math.pi
        theta_r = (second**2 - first * third) / (first - third)
    return delta, theta_r


def from_amplitudes(peaks: Floats, times: Floats, reading: Reading, parity: int) -> Decrement:
    """Return the result of eqs. 2.7 and 2.10; ``parity`` is that of the first peak's number."""
    if reading == "odd_triplets":
        deltas, thetas = (values[1 - parity :: 2] for values in triplets(peaks))
        delta, theta_r = float(np.mean(deltas)), float(np.mean(thetas))
    else:
        used = peaks
        if reading == "odd_ends":
            # Both pairs of neighbours in eq. 2.7 begin at an odd peak.
            used = used[1 - parity :]
            used = used[: used.size - used.size % 2]
        delta, theta_r = decrement(used), coulomb(used)
    return Decrement(delta, theta_r, mean_period(times))


def small_peaks(peaks: Peaks, cut: float = CUT) -> tuple[Peaks, list[str]]:
    """Return the longest row of consecutive peaks below a cut, and warnings."""
    small = peaks.turned
    above = np.flatnonzero(np.abs(small.amplitude) >= cut)
    small = small.select(np.arange(len(small)) > (above[-1] if above.size else -1))
    gaps = np.flatnonzero(np.diff(small.index) != 1)
    warnings = []
    if gaps.size:
        parts = np.split(np.arange(len(small)), gaps + 1)
        longest = max(parts, key=len)
        warnings.append(f"peaks are missing: the longest sequence, of {longest.size}, is used")
        small = small.select(np.isin(np.arange(len(small)), longest))
    return small, warnings


def from_peaks(peaks: Peaks, *, reading: Reading = "all", cut: float = CUT) -> Identification:
    """Identify viscous damping and Coulomb friction by the combined decrement as printed.

    Peaks above the cut (12 degrees) are excluded; eq. 2.7 gives ``delta``, eq. 2.10 ``theta_r``,
    the mean period ``w0 = 2 pi / (mean_period sqrt(1 - zeta^2))``; standard errors are by the delta
    method, intervals by a parametric bootstrap of the peaks. The paper starts "only on odd half
    cycles": ``odd_ends`` applies eq. 2.7 to the first and the last pair of peaks that begin at an
    odd peak, ``odd_triplets`` averages over such triplets. The method is biased by the nonlinearity
    (1.5 % in delta at 12 degrees) and by a zero error of the angle, and eq. 2.7 uses only four
    peaks; the module ``repaired`` corrects that.
    """
    small, warnings = small_peaks(peaks, cut)
    size = np.abs(small.amplitude)
    while size.size > _FEWEST and not size[-2] > size[-1]:
        size = size[:-1]
    if size.size < len(small):
        few = len(small) - size.size
        warnings.append(f"the last peaks ({few}) do not decrease and were dropped")
        small = small.select(np.arange(len(small)) < size.size)
    least = _FEWEST + (reading != "all") * 2
    if size.size < least:
        where = f"under {math.degrees(cut):.3g} degrees"
        why = ": the record ends above it" if len(peaks) and not len(small) else ""
        return too_few(size.size, least, len(peaks.turned), where, warnings, why)
    parity = int(small.index[0]) % 2
    count = len(small)

    def compute(values: Floats) -> Floats:
        return from_amplitudes(values[:count], values[count:], reading, parity).si

    values = np.concatenate((size, small.time))
    stderr = np.concatenate((small.stderr_amplitude, small.stderr_time))
    estimates = compute(values)
    if not np.isfinite(estimates).all():
        reason = "a difference of peaks has the wrong sign: no logarithm in eq. 2.7"
        return inapplicable(reason, warnings)
    covariance = propagated(compute, values, stderr)
    draws = bootstrap(compute, values, stderr)
    failed = float(np.mean(~np.isfinite(draws).all(axis=1)))
    names = ("w0", "c_over_m", "Tr")
    low, high = np.nanpercentile(draws, (2.5, 97.5), axis=0)
    intervals = {n: (float(low[j]), float(high[j])) for j, n in enumerate(names)}
    if failed > 0.01:  # noqa: PLR2004 (an interval at 95 % hardly notices fewer)
        warnings.append(
            f"noise reverses the sign of a difference of peaks in {failed:.0%} of simulated "
            "repetitions: the errors are too small"
        )
    return identified(
        names,
        estimates,
        covariance,
        intervals=intervals,
        used=(
            f"peaks {small.index[0]} to {small.index[-1]} ({count}, under {math.degrees(cut):.3g} "
            f"degrees); {_USES[reading]}; the mean of {count - 2} overlapping periods"
        ),
        warnings=warnings,
    )
