"""Table 1 and figure 7 of the paper: errors of simulated periods and peaks against a record's."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.analysis.trajectory import simulate
from pendmap.errors import InputError
from pendmap.signal.robust import rms

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pendmap.identification.methods.base import Identification
    from pendmap.identification.peaks import Peaks
    from pendmap.model import Rig
    from pendmap.signal import Floats

PERIODS: Final = (0.26, 1.54)
"""Periods of the paper's table, s; on a slower rig the first is that of small swings."""
PEAKS: Final = (1.2, 2.53)  # Peaks of the paper's table, rad

_SAME: Final = 1e-9  # Interval below which events are identical, s


@dataclasses.dataclass(frozen=True)
class State:
    """Initial state of a simulation, at rest: time (s) and recorded angle (rad)."""

    time: float
    theta: float


@dataclasses.dataclass(frozen=True)
class PeakErrors:
    """Figure 7 for one model: relative errors of simulated periods and peaks, percent.

    Parameters
    ----------
    method : str
        Name of the model.
    period_time, period, period_error : array, shape (Q,)
        Start of each full cycle (s), measured period (s), error; NaN if the simulation is at rest.
    peak_index, peak, peak_error : array, shape (P,)
        Number of each peak, its measured amplitude (rad), and the error.
    """

    method: str
    period_time: Floats
    period: Floats
    period_error: Floats
    peak_index: NDArray[np.int64]
    peak: Floats
    peak_error: Floats

    @property
    def period_rms(self) -> float:
        """Root mean square of the period errors, percent; NaN if there are none."""
        return rms(self.period_error)

    @property
    def peak_rms(self) -> float:
        """Root mean square of the peak errors, percent; NaN if there are none."""
        return rms(self.peak_error)


@dataclasses.dataclass(frozen=True)
class Row:
    """Row of table 1."""

    what: str  # period or peak
    asked: float  # value in the paper's table, s or rad
    measured: float  # nearest value in this record
    errors: Mapping[str, float]  # absolute errors by method, percent; NaN if at rest


@dataclasses.dataclass(frozen=True)
class Table1:
    """Table 1 of a record, with the data of figure 7.

    Rows have different measured values, none the peak at which simulations start. ``left_out`` is
    the reason why a record with peaks has no table, or empty. ``lost`` has the reason, by method,
    why a model cannot be simulated from the first peak.
    """

    rows: tuple[Row, ...]
    errors: Mapping[str, PeakErrors]
    left_out: str = ""
    lost: Mapping[str, str] = dataclasses.field(default_factory=dict)


def first_state(peaks: Peaks) -> State:
    """Return the initial state of simulations, the first peak, at which the velocity is zero."""
    turned = peaks.turned
    return State(float(turned.time[0]), float(turned.amplitude[0]))


def simulated_peaks(rig: Rig, start: State, until: float) -> tuple[Floats, Floats]:
    """Return times (s) and angles (rad) of a model's peaks after an initial state."""
    run = simulate(rig, start.theta, 0.0, max(until - start.time, 1e-3), samples=1)
    kinds = run["event_kind"].values
    turned = np.isin(kinds, ("turn", "stick", "stuck for ever"))
    times, angles = run["event_time"].values[turned], run["event_theta"].values[turned]
    # A permanent stop has two events: its start and its confirmation.
    new = np.diff(times, prepend=-math.inf) > _SAME
    times, angles = times[new], angles[new]
    if times.size == 0 or times[0] > _SAME:
        times, angles = np.append(0.0, times), np.append(start.theta, angles)
    return times + start.time, angles


def peak_errors(identification: Identification, peaks: Peaks, start: State) -> PeakErrors:
    """Return the errors of a simulation from ``start``, which has the sensor's zero error."""
    turned = peaks.turned
    origin = dataclasses.replace(start, theta=start.theta - identification.zero)
    span = float(turned.time[-1]) - start.time
    times, angles = simulated_peaks(identification.rig, origin, start.time + 1.2 * span + 5.0)
    return errors_of(identification.method, peaks, times, angles + identification.zero)


def errors_of(method: str, peaks: Peaks, times: Floats, angles: Floats) -> PeakErrors:
    """Return errors of simulated peaks (s, rad, with the sensor's errors), matched by number."""
    turned = peaks.turned
    number = turned.index - turned.index[0]
    made_time, made = (np.full(int(number[-1]) + 1, math.nan) for _ in range(2))
    size = min(made.size, times.size)
    made_time[:size], made[:size] = times[:size], angles[:size]
    at = np.flatnonzero(turned.index[2:] - turned.index[:-2] == 2)  # noqa: PLR2004 (one cycle)
    period = turned.time[at + 2] - turned.time[at]
    other = made_time[number[at + 2]] - made_time[number[at]]
    return PeakErrors(
        method=method,
        period_time=turned.time[at],
        period=period,
        period_error=100 * (other - period) / period,
        peak_index=turned.index,
        peak=np.abs(turned.amplitude),
        peak_error=100 * (made[number] / turned.amplitude - 1),
    )


def table1(record_peaks: Peaks, identifications: Mapping[str, Identification]) -> Table1:
    """Compare simulations of identified models from the first peak with a record.

    The rows have the measured periods and peaks nearest to those of the paper's table.

    Parameters
    ----------
    record_peaks : Peaks
        Peaks of the record, as from :func:`pendmap.identification.find_peaks`.
    identifications : mapping of str to Identification
        ``methods`` of :func:`pendmap.identify`; inapplicable ones are ignored.

    Returns
    -------
    Table1

    References
    ----------
    Horton, Wiercigroch & Xu (2008), Phil. Trans. R. Soc. A, table 1 and figure 7.
    """
    if len(record_peaks.turned) < 3:  # noqa: PLR2004 (one full cycle)
        return Table1((), {}, record_peaks.lacking)
    start = first_state(record_peaks)
    errors, lost = {}, {}
    for name, identification in identifications.items():
        if not identification.applicable:
            continue
        try:
            errors[name] = peak_errors(identification, record_peaks, start)
        except InputError as error:
            lost[name] = str(error)
    # One measured value may be nearest to several values of the paper.
    rows: dict[tuple[str, float], Row] = {}
    for what, asked in [*(("period", t) for t in PERIODS), *(("peak", a) for a in PEAKS)]:
        if row := _row(what, asked, errors):
            rows.setdefault((what, row.measured), row)
    return Table1(tuple(rows.values()), errors, lost=lost)


def _row(what: str, asked: float, errors: Mapping[str, PeakErrors]) -> Row | None:
    """Return the row of the measured value nearest to ``asked``; None if there is none."""
    column, measured, peak = {}, math.nan, what == "peak"
    for name, one in errors.items():
        there, wrong = (one.peak, one.peak_error) if peak else (one.period, one.period_error)
        if there.size == 0:
            return None
        # A period below all measured ones would select the last, noisiest ones.
        least = -math.inf if peak else float(np.median(there[there.size // 2 :]))
        near = int(np.argmin(np.abs(there - max(asked, least))))
        if peak and near == 0:  # the simulation starts there, without error
            return None
        measured, column[name] = float(there[near]), abs(float(wrong[near]))
    return Row(what, asked, measured, column) if column else None
