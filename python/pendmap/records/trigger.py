"""Rules of a trigger: edges that mark releases or recur with the drive."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted, listed

if TYPE_CHECKING:
    from pendmap.records.experiment import Finding
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Indices

BETWEEN_LEVELS: Final = 0.02  # Greatest share of samples between the two levels
DEAD_BAND: Final = 0.2  # Half-width of the hysteresis band, over the distance of the levels
RELEASES_APART: Final = 3.0  # Least time between releases, periods of small swings
BOUNCE: Final = 0.3  # Drive periods within which a second edge is a bounce
FEWEST_EDGES: Final = 4  # Fewest edges from which the frequency of a drive is estimated
UNEVEN_EDGES: Final = 0.1  # Greatest rms deviation of edges from periodicity, drive periods
DIFFERENT: Final = 3.0  # Standard errors above which a given frequency or phase is contradicted


@dataclasses.dataclass(frozen=True)
class Beat:
    """Frequency and edges of a drive, estimated from its trigger."""

    omega: float  # rad/s
    stderr: float  # standard error of omega, rad/s
    time: Floats  # midpoints between the samples before and after each edge, s, shape (M,)
    error: float  # standard error of one time, s
    left_out: int  # number of bounces


def edges_of(values: Floats, edge: str | None = None) -> tuple[Indices, str] | None:
    """Return the first samples after each edge, and the direction of the edges.

    The threshold is midway between the means of the two levels; missing values keep the level. By
    default rising edges are used, or falling ones if there are no others. Returns None without two
    levels.
    """
    seen = values[np.isfinite(values)]
    if seen.size == 0 or np.ptp(seen) == 0:
        return None
    threshold = (float(seen.min()) + float(seen.max())) / 2
    for _ in range(20):
        low, high = float(seen[seen <= threshold].mean()), float(seen[seen > threshold].mean())
        middle = (low + high) / 2
        if not seen.min() < middle < seen.max() or middle == threshold:
            break
        threshold = middle
    band = DEAD_BAND * (high - low)
    if np.mean(np.abs(seen - threshold) < band) > BETWEEN_LEVELS:
        return None
    state = np.where(values > threshold + band, 1, np.where(values < threshold - band, -1, 0))
    places = np.flatnonzero(state)
    signs = state[places]
    turns = np.flatnonzero(np.diff(signs)) + 1
    rising, falling = places[turns[signs[turns] > 0]], places[turns[signs[turns] < 0]]
    if edge is None:
        edge = "rising" if rising.size or not falling.size else "falling"
    return (rising if edge == "rising" else falling), edge


def _debounced(time: Floats, places: Indices, dead: float) -> list[int]:
    """Return the edges that do not follow an accepted one within ``dead``, s."""
    accepted: list[int] = []
    for k in places.tolist():
        if not accepted or time[k] - time[accepted[-1]] > dead:
            accepted.append(k)
    return accepted


def releases(work: Work) -> Finding | None:
    """Keep the motion after each edge of a trigger that marks releases."""
    if not work.parts or "trigger" not in work.extra:
        return None
    edges = edges_of(work.extra["trigger"], work.edge)
    if edges is None or not edges[0].size:
        return work.finding("trigger-unlike.none", why=_none(edges))
    places, edge = edges
    marked = _debounced(work.time, places, work.period)
    apart = np.diff(work.time[marked])
    if apart.size and np.median(apart) < RELEASES_APART * work.period:
        number = counted(len(marked), f"{edge} edge")
        return work.finding("trigger-unlike.often", edges=number, apart=np.median(apart))
    motions = []
    for low, high in itertools.pairwise([*marked, work.time.size]):
        after = [(max(a, low), min(b, high)) for a, b in work.parts if a < high and b > low]
        if after:
            a, b = max(after, key=lambda part: part[1] - part[0])
            # The trigger locates the release to a sample, the angle to a fraction of a swing.
            motions.append((low if work.time[a] - work.time[low] < work.period else a, b))
    if not motions:
        return work.finding("trigger-unlike.still")
    work.parts = motions
    times = listed([f"{work.time[k]:.6g}" for k in marked], 6)
    number, bounces = counted(len(marked), "release"), _bounces(places.size - len(marked))
    return work.finding("trigger-release", edge=edge, releases=number, times=times, bounces=bounces)


def _bounces(number: int) -> str:
    """Return the text on the number of edges excluded as bounces."""
    return f"; {counted(number, 'bounce')} left out" if number else ""


def _none(edges: tuple[Indices, str] | None) -> str:
    """Return the reason why there is no edge, as text."""
    return "does not have two levels" if edges is None else f"has no {edges[1]} edge"


def beat_of(time: Floats, places: Indices, omega: float | None = None) -> Beat | None:
    """Return the frequency of periodic edges; None if they are not periodic.

    Each edge is between two samples, so the edges bound the period by ``(t_j - t_i +- (d_i + d_j) /
    2) / (n_j - n_i)``, with the interval d at an edge and its number n; the error is that of a
    uniform distribution. If no period is within all bounds, it is the slope of the least-squares
    line of t over n. ``omega`` is the expected frequency, rad/s, to recognize bounces.
    """
    if places.size < FEWEST_EDGES:
        return None
    # Without a known frequency, long intervals are taken for periods, short ones for bounces.
    period = 2 * math.pi / omega if omega else float(np.quantile(np.diff(time[places]), 0.9))
    clear = np.asarray(_debounced(time, places, BOUNCE * period), np.intp)
    if clear.size < FEWEST_EDGES:
        return None
    before, after = time[clear - 1], time[clear]
    middle = (before + after) / 2
    apart = np.diff(middle)
    number = np.concatenate([[0.0], np.cumsum(np.round(apart / float(np.median(apart))))])
    if np.any(np.diff(number) < 1):
        return None
    (period, start), covariance = np.polyfit(number, middle, 1, cov="unscaled")
    rest = middle - start - period * number
    sampling = float(np.mean(after - before)) / math.sqrt(12)
    spread = float(np.sqrt(np.sum(rest**2) / (rest.size - 2)))
    if period <= 0 or spread > UNEVEN_EDGES * period + 2 * sampling:
        return None
    error = max(spread, sampling) * math.sqrt(float(covariance[0, 0]))
    low, high = 0.0, math.inf
    for k in range(1, clear.size):
        steps = number[k:] - number[:-k]
        low = max(low, float(np.max((before[k:] - after[:-k]) / steps)))
        high = min(high, float(np.min((after[k:] - before[:-k]) / steps)))
    if low <= high:
        period, error = (low + high) / 2, (high - low) / math.sqrt(12)
    w = 2 * math.pi / period
    return Beat(w, w * error / period, middle, max(spread, sampling), places.size - clear.size)


def drive_missing(work: Work) -> Finding | None:
    """Report a forced run without a drive."""
    if work.free or work.plan.drive is not None or work.plan.pivot is not None:
        return None
    return work.finding("drive-missing")


def drive(work: Work) -> Finding | None:
    """Report the trigger's frequency of a forced run; set the drive's phase if it is unknown."""
    if "trigger" not in work.extra:
        return None
    edges = edges_of(work.extra["trigger"], work.edge)
    given = (work.plan.drive or {}).get("Omega")
    beat = beat_of(work.time, edges[0], given) if edges else None
    if edges is None or beat is None:
        why = f" {_none(edges)}"
        if edges and edges[0].size:
            number = counted(edges[0].size, f"{edges[1]} edge")
            uneven = f"'s {number} do not recur evenly"
            why = uneven if edges[0].size >= FEWEST_EDGES else f" has {number}"
        return work.finding("trigger-unlike.drive", why=why)
    number, bounces = counted(beat.time.size, f"{edges[1]} edge"), _bounces(beat.left_out)
    omega, error = beat.omega, beat.stderr
    if given is not None and abs(beat.omega - given) > DIFFERENT * beat.stderr:
        return work.finding(
            "trigger-differs.frequency",
            omega=omega,
            error=error,
            edges=number,
            bounces=bounces,
            given=given,
        )
    if given is not None and work.phase is not None:
        work.doubt = _phase(work, beat, given, work.phase)
    return work.finding("trigger-drive", omega=omega, error=error, edges=number, bounces=bounces)


def _phase(work: Work, beat: Beat, omega: float, phase: float) -> Finding | None:
    """Set the drive's phase from the edges, ``phi = phase - Omega t``, or compare a given one."""
    drive = work.plan.drive or {}
    mean = np.mean(np.exp(1j * (phase - omega * beat.time)))
    phi, given = float(np.angle(mean)), drive["phi"]
    # Edges synchronous with the sampling have a common error, which averaging does not reduce.
    error = omega * beat.error
    if given is None:
        work.plan = dataclasses.replace(work.plan, drive={**drive, "phi": phi})
        return work.finding("trigger-phase", phi=phi, error=error, phase=phase)
    if abs(math.remainder(given - phi, 2 * math.pi)) > DIFFERENT * error:
        return work.finding("trigger-differs.phase", phi=phi, error=error, given=given)
    return None
