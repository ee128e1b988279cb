"""Critical curves of rest: refinement of their frequencies, and curves by perturbation.

For the damped Mathieu equation ``th'' + gamma th' + (1 + p cos(omega tau)) th = 0`` a periodic
solution is written with few harmonics, and those that are not resonant are eliminated, their
damping left out: the methods of Struble, of averaging and of multiple scales agree to this order.
First tongue, about ``omega = 2``, ``a = 1 - omega^2/4``, ``c = gamma omega/2``: to first order
``a^2 + c^2 = p^2/4``; the third harmonic, ``C = (p/2) A / (9 omega^2/4 - 1)``, adds ``k p^2``,
``k = 1/(9 omega^2 - 4)``, to ``a``. Second tongue, about ``omega = 1``, ``a = 1 - omega^2``,
``c = gamma omega``: the constant ``-(p/2) A`` takes ``p^2/2`` off the stiffness of the cosine, the
second harmonic adds ``s p^2``, ``s = 1/(4 (4 omega^2 - 1))``, to both:
``(a - (1/2 - s) p^2)(a + s p^2) + c^2 = 0``.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Self

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pendmap._core import CriticalAmplitudes
    from pendmap.signal import Floats, Indices, Mask


_BENT = 2e-3  # Largest distance of a drawn line from its curve, fraction of the figure's height

_APART = 4e-3
"""Distance of two branches, or of a curve and the end of the search, below which the curve ends
there, fraction of the figure's height."""

_STRIP = 1e-6
"""Height of a stable strip, fraction of the figure's, below which rounding hides its edges."""

_STEP = 1 / 1000
"""Width of an interval below which bends are not resolved, fraction of the figure's width."""

_NOSE = 1e-6
"""Width of an interval in which a curve turns back, below which it is not halved, fraction of the
figure's width. Near such a turn the height varies as the square root of the distance."""

_GRADED = 4.5  # Largest ratio of an interval to its neighbours

_ROUNDS = 24  # Largest number of halvings of an interval
_IN_VIEW = 1.05  # Height up to which curves are refined, fraction of the figure's height
PLANES = ("omega-p", "e-alpha2")
"""Eq. 1.2's ``(omega, p)``, and eq. 1.4's ``(alpha^2, e) = (1/omega^2, p/omega^2)``."""
_HIGHEST = 2.6  # Largest ``e`` of a figure in the plane of eq. 1.4, if it was computed


def denser(
    frequencies: Floats,
    results: list[Any],
    solve: Callable[[Floats], list[Any]],
    curves: Callable[[Any], list[tuple[Floats, Floats]]],
    views: Sequence[Callable[[Floats, Floats], tuple[Floats, Floats]]],
) -> tuple[Floats, list[Any]]:
    """Return frequencies refined where curves end, turn or bend in view, and the results there.

    ``solve`` returns the results at further frequencies; ``curves`` maps the result at one to
    amplitudes, ascending, the last the end of the search, and multipliers, for each model;
    ``views`` map frequencies and amplitudes to a figure that is [0, 1] wide and high.
    """
    results = list(results)
    for _ in range(_ROUNDS):
        rows = [curves(one) for one in results]
        wanted = np.zeros(frequencies.size - 1, dtype=bool)
        for view in views:
            x = view(frequencies, np.zeros_like(frequencies))[0]
            for model in zip(*rows, strict=True):
                columns = [
                    _Column.of(view(np.full_like(p, w), p)[1], multiplier)
                    for w, (p, multiplier) in zip(frequencies, model, strict=True)
                ]
                wanted |= _wanted(x, columns)
        halved = _graded(np.diff(frequencies), wanted)
        if not halved.size:
            break
        between = (frequencies[halved] + frequencies[halved + 1]) / 2
        more = solve(between)
        frequencies = np.insert(frequencies, halved + 1, between)
        for k, one in sorted(zip(halved, more, strict=True), key=lambda pair: -pair[0]):
            results.insert(k + 1, one)
    return frequencies, results


@dataclass(frozen=True)
class _Column:
    """Critical points at one frequency, as fractions of the figure's height."""

    heights: Floats
    multiplier: Floats
    end: float
    """Height of the largest amplitude of the search."""

    @classmethod
    def of(cls, heights: Floats, multiplier: Floats) -> Self:
        """Return a column without the two edges of a stable strip that is only a line."""
        indices: list[int] = []
        for k, height in enumerate(heights[:-1]):
            other = indices and multiplier[indices[-1]] == -multiplier[k]
            if other and height - heights[indices[-1]] < _STRIP:
                indices.pop()
            else:
                indices.append(k)
        return cls(heights[indices], multiplier[indices], float(heights[-1]))


def _wanted(x: Floats, columns: Sequence[_Column]) -> Mask:
    """Return which intervals must be halved for the curves of one model."""
    widths = np.abs(np.diff(x))
    wanted = np.zeros(widths.size, dtype=bool)
    for k, (a, b) in enumerate(pairwise(columns)):
        if a.heights.size != b.heights.size and widths[k] > _NOSE:
            wanted[k] |= _seen_to_end(a, b)
    for k in range(1, x.size - 1):
        before, here, after = (one.heights for one in columns[k - 1 : k + 2])
        if not here.size == before.size == after.size:
            continue
        part = (x[k] - x[k - 1]) / (x[k + 1] - x[k - 1])
        off = np.abs(before + part * (after - before) - here) > _BENT
        if (off & (np.minimum(before, after) < _IN_VIEW)).any():
            wanted[k - 1] |= bool(widths[k - 1] > _STEP)
            wanted[k] |= bool(widths[k] > _STEP)
    return wanted


def _seen_to_end(a: _Column, b: _Column) -> bool:
    """Return whether a curve in only one of two columns ends in view, without turning back."""
    short, long = sorted((a, b), key=lambda one: one.heights.size)
    extra = long.heights.size - short.heights.size

    def left(k: int) -> float:
        shortened = np.delete(long.heights, slice(k, k + extra))
        return float(np.abs(shortened - short.heights).sum())

    first = min(range(short.heights.size + 1), key=left)
    gone = slice(first, first + extra)
    heights, multiplier = long.heights[gone], long.multiplier[gone]
    ended = long.end - heights < _APART
    turns = (np.diff(heights) < _APART) & (np.diff(multiplier) == 0)
    ended[1:] |= turns
    ended[:-1] |= turns
    return bool((~ended & (heights < _IN_VIEW)).any())


def _graded(widths: Floats, wanted: Mask) -> Indices:
    """Return indices of intervals to halve, including those much longer than a neighbour."""
    while True:
        after = np.where(wanted, widths / 2, widths)
        longer = np.zeros_like(wanted)
        longer[1:] |= after[1:] > _GRADED * after[:-1]
        longer[:-1] |= after[:-1] > _GRADED * after[1:]
        longer &= ~wanted
        if not longer.any():
            return np.flatnonzero(wanted)
        wanted = wanted | longer


def fold_ends(
    omega: Floats,
    rows: list[CriticalAmplitudes],
    looked: Mask,
    solve: Callable[[Floats], list[CriticalAmplitudes]],
) -> Mask:
    """Bisect added frequencies for the ends of folds; return where folds were sought."""
    while True:
        places = np.flatnonzero(looked)
        folded = np.array([rows[k].fold is not None for k in places])
        change = (folded[1:] != folded[:-1]) & (np.diff(places) > 1)
        middles = ((places[:-1] + places[1:]) // 2)[change]
        if not middles.size:
            return looked
        for k, row in zip(middles, solve(omega[middles]), strict=True):
            rows[k] = row
        looked[middles] = True


def in_plane(omega: Floats, p: Floats, plane: str) -> tuple[Floats, Floats]:
    """Convert frequencies and amplitudes to coordinates in one of :data:`PLANES`."""
    if plane == PLANES[0]:
        return omega, p
    square = 1 / np.asarray(omega) ** 2
    return square, p * square


def window(omega: Floats, p_max: float, plane: str) -> tuple[tuple[float, float], float]:
    """Return the ends of a figure's abscissa, and its height above 0."""
    low, high = float(omega[0]), float(omega[-1])
    if plane == PLANES[0]:
        aside = 0.0 if low < high else 0.05 * low
        return (low - aside, high + aside), p_max
    return (0.0, 1 / low**2), min(_HIGHEST, p_max / low**2)


def in_picture(
    omega: Floats, p_max: float, plane: str
) -> Callable[[Floats, Floats], tuple[Floats, Floats]]:
    """Return the map from frequency and amplitude to a figure [0, 1] wide and high."""
    (left, right), top = window(omega, p_max, plane)

    def to(at: Floats, p: Floats) -> tuple[Floats, Floats]:
        x, y = in_plane(at, p, plane)
        return (x - left) / (right - left), y / top

    return to


def first_tongue(omega: Floats, gamma: float) -> Floats:
    """Return critical ``p`` of the first tongue to first order; nan nearer to the second tongue."""
    a, c = 1 - omega**2 / 4, gamma * omega / 2
    return np.where(omega > 1.0, 2 * np.hypot(a, c), np.nan)


def first_tongue_second_order(omega: Floats, gamma: float) -> Floats:
    """Return critical ``p`` of the first tongue to second order; nan if there is none."""
    a, c = 1 - omega**2 / 4, gamma * omega / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        k = 1 / (9 * omega**2 - 4)
        # k^2 P^2 + (2 a k - 1/4) P + a^2 + c^2 = 0 in P = p^2: the root that is finite for k = 0.
        half = 1 / 8 - a * k
        square = (a**2 + c**2) / (half + np.sqrt(half**2 - k**2 * (a**2 + c**2)))
        amplitude = np.sqrt(square)
    # Left of 2/3 the third harmonic is resonant before the first.
    return np.where((omega > 1.0) & np.isfinite(amplitude), amplitude, np.nan)


def second_tongue(omega: Floats, gamma: float) -> Floats:
    """Return critical ``p`` of the second tongue to second order; nan if there is none."""
    a, c = 1 - omega**2, gamma * omega
    with np.errstate(divide="ignore", invalid="ignore"):
        s = 1 / (4 * (4 * omega**2 - 1))
        # s (1/2 - s) P^2 + a (1/2 - 2 s) P - (a^2 + c^2) = 0.
        leading, half = s * (0.5 - s), a * (0.5 - 2 * s) / 2
        square = (-half + np.sqrt(half**2 + leading * (a**2 + c**2))) / leading
        amplitude = np.sqrt(square)
    # Left of 1/sqrt(2) the second harmonic is nearly resonant itself.
    return np.where((omega > np.sqrt(0.5)) & np.isfinite(amplitude), amplitude, np.nan)


CURVES: dict[str, tuple[int, Callable[[Floats, float], Floats]]] = {
    "tongue 1, first order": (-1, first_tongue),
    "tongue 1, second order": (-1, first_tongue_second_order),
    "tongue 2, second order": (1, second_tongue),
}
"""Name of each curve, the multiplier on it, and its formula."""


def asymptotic(
    rows: list[CriticalAmplitudes], omega: Floats, gamma: float, p_max: float
) -> tuple[Floats, Floats]:
    """Return the asymptotic curves and their errors against exact ones of equal multiplier."""
    curves, errors = [], []
    for multiplier, formula in CURVES.values():
        p = formula(omega, gamma)
        p[p > p_max] = np.nan
        error = np.full_like(p, np.nan)
        for k, row in enumerate(rows):
            exact = [q for q, m in zip(row.p, row.multiplier, strict=True) if m == multiplier]
            if exact and np.isfinite(p[k]):
                nearest = min(exact, key=lambda q: abs(q - p[k]))
                error[k] = abs(p[k] - nearest) / nearest if nearest else np.nan
        curves.append(p)
        errors.append(error)
    return np.array(curves), np.array(errors)
