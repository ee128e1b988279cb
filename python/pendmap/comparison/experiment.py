"""Comparison of a model with an experiment's runs, with its JSON and text."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np
import pandas as pd

from pendmap.analysis.run import part
from pendmap.comparison.forced import FEWEST, Ensemble, ForcedComparison, compare_forced
from pendmap.comparison.free import ARRAYS, COLUMNS, MODEL, RunComparison, compare_free
from pendmap.errors import (
    MOST_THREADS,
    FitDiverged,
    InputError,
    check_callable,
    check_type,
    check_whole,
)
from pendmap.files.saved import Saved
from pendmap.formatting import counted, percent
from pendmap.model import Rig
from pendmap.records import experiment_of
from pendmap.records.summary import doubt_lines, doubts, finding_lines

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from pendmap.comparison.forced import Statistic
    from pendmap.comparison.steady import Cycle, Steady
    from pendmap.formatting import Table
    from pendmap.records import Experiment, Run
    from pendmap.records.read import Records
    from pendmap.signal import Floats


_UNITS: Final = {"period": "s", "peak": "rad"}
FITS: Final = 1.1
"""Rms residual over noise up to which a model fits; the noise is known to a few percent."""


@dataclasses.dataclass(frozen=True, repr=False)
class Comparison(Saved):
    """Comparison of a model with an experiment.

    Parameters
    ----------
    model : Rig
        The model with its effects, including those on the reading.
    experiment : Experiment
        The records.
    runs : tuple of RunComparison
        Comparisons with the free decays.
    forced : tuple of ForcedComparison
        Comparisons with the forced runs.
    left_out : tuple of (str, str)
        Name of each other run, and the reason why it is not compared.
    """

    KIND: ClassVar[str] = "comparison"
    ARRAYS = ARRAYS
    ROWS: ClassVar[str] = "row"
    COLUMNS = COLUMNS

    model: Rig
    experiment: Experiment
    runs: tuple[RunComparison, ...]
    forced: tuple[ForcedComparison, ...] = ()
    left_out: tuple[tuple[str, str], ...] = ()

    def __repr__(self) -> str:
        worst = max(one.rms / one.sigma for one in self.every)
        rms, runs = f"rms up to {worst:.3g} times the noise", counted(len(self.every), "run")
        return f"<Comparison {self.experiment.path.name}: {runs}, {rms}; {self.model.title}>"

    @property
    def every(self) -> tuple[RunComparison | ForcedComparison, ...]:
        """All runs that were compared, free decays first."""
        return (*self.runs, *self.forced)

    def to_dataframe(self) -> pd.DataFrame:
        """Return one row a run and quantity.

        Returns
        -------
        pandas.DataFrame
            Index ``run`` and ``quantity``; ``record`` and ``model`` (of an ensemble the median),
            ``low`` and ``high`` (95 % of the ensemble), ``chance`` (its two-sided p-value of the
            record), ``error_percent`` (absolute), nan where there is none, and ``unit``. The
            quantity ``residual`` has the noise of the record and the rms of the model.
        """
        rows: list[tuple[Any, ...]] = []
        for one in self.every:
            name = one.run.name
            rows.append((name, "residual", one.sigma, one.rms, *[math.nan] * 4, "rad"))
            if isinstance(one, RunComparison):
                for r in one.table.rows:
                    quantity, error = f"{r.what} {r.measured:g}", r.errors.get(MODEL, math.nan)
                    unit = _UNITS[r.what]
                    rows.append((name, quantity, r.measured, *[math.nan] * 4, error, unit))
            else:
                rows += [
                    (name, e.name, e.measured, e.median, *e.ci95, e.chance, math.nan, e.unit)
                    for e in one.statistics
                ]
        columns = ["run", "quantity", "record", "model", "low", "high", "chance", "error_percent"]
        table = pd.DataFrame(rows, columns=[*columns, "unit"])
        return table.astype({"unit": "string"}).set_index(columns[:2])

    def text_parts(self) -> tuple[list[Table], list[str]]:
        """Return the tables and the lines that ``pendmap compare`` prints."""
        tables = [_free_table(self.runs), _forced_table(self.forced)]
        return [table for table in tables if table[1]], list(_lines(self))


def compare(  # noqa: PLR0913 (each is asked for by name)
    model: Rig,
    records: Records | Sequence[Records],
    *,
    ensemble: Ensemble | None = None,
    rate_hz: float | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Comparison:
    """Compare a model with every run of an experiment.

    No parameter of the model is fitted. Of a free decay, angle and velocity at the first free
    sample are fitted, since they are known only to the noise; periods and peaks are those of the
    motion from the first measured peak.

    A forced run may be chaotic, and chaotic trajectories diverge however good the model is. It is
    compared with an ensemble of simulated records over a neighbourhood of its initial state, by the
    wells visited, escapes between them, the angle covered, the time to settle and the greatest
    velocity; if it ends on a steady state, also with the model's cycle at equal phase of the drive.
    Its residual is computed in windows of up to three swings, each with a fitted initial state.

    Parameters
    ----------
    model : Rig
        Model in SI units, from :func:`pendmap.load_model`.
    records : path, DataFrame, Experiment, Run, or a sequence of these
        As for :func:`pendmap.identify`; forced runs too.
    ensemble : Ensemble, optional
        Number and spread of the initial states for a forced run.
    rate_hz : float, optional
        Sampling rate, Hz, of records without a column of times.
    threads : int, optional
        Number of threads; by default one per processor.
    progress : callable, optional
        Called repeatedly with the number of members done and in all, for each forced run.

    Returns
    -------
    Comparison
        Comparisons with each run.

    Raises
    ------
    InputError
        If no run can be compared: one needs samples with motion, a forced one also a known drive.
    OSError
        If a file cannot be read.
    KeyboardInterrupt
        After Ctrl-C.

    Examples
    --------
    >>> import numpy as np
    >>> import pendmap
    >>> rig = pendmap.Rig(w0=6.2, c_over_m=0.05, Tr=0.08)
    >>> decay = pendmap.simulate(rig, theta=1.0, velocity=0.0, t_eval=np.arange(0, 20, 0.02))
    >>> angle = decay.theta.values + np.random.default_rng(0).normal(0, 1e-3, decay.time.size)
    >>> every = np.ones(angle.size, bool)
    >>> run = pendmap.Run("a", "a.csv", "free", decay.time.values, angle, every)
    >>> round(pendmap.compare(rig, run).runs[0].rms, 4)
    0.001
    """
    check_type("model", model, Rig, "pendmap.load_model('model.toml') in SI")
    experiment = experiment_of(records, rate_hz=rate_hz)
    if ensemble is not None:
        check_type("ensemble", ensemble, Ensemble, "pendmap.Ensemble(members=400)")
    if threads is not None:
        check_whole("threads", threads, 1, MOST_THREADS)
    check_callable("progress", progress)
    sampled = [run for run in experiment.runs if not run.peaks_only]
    if not sampled:
        raise InputError(f"{experiment.path}: one run or more must have samples, none has")
    experiment.refuse_still(sampled)
    free: list[RunComparison] = []
    forced: list[ForcedComparison] = []
    out: list[tuple[str, str]] = []
    driven = [run.name for run in experiment.runs if run.kind != "free"]
    for run in experiment.runs:
        try:
            _check_comparable(model, run)
            if run.kind == "free":
                free.append(compare_free(model, run))
            else:
                forced.append(
                    compare_forced(
                        model,
                        run,
                        ensemble or Ensemble(),
                        threads=threads,
                        progress=part(progress, driven.index(run.name), len(driven)),
                    )
                )
        except (FitDiverged, InputError) as error:  # the other runs are still compared
            out.append((run.name, str(error)))
    if not free and not forced:
        reasons = "; ".join(": ".join(pair) for pair in out)
        raise InputError(f"{experiment.path}: no run can be compared: {reasons}")
    return Comparison(model, experiment, tuple(free), tuple(forced), tuple(out))


def _check_comparable(model: Rig, run: Run) -> None:
    """Raise InputError with the reason why a run cannot be compared with a model."""
    time, swing = run.time[run.trusted], math.tau / model.w0
    seconds = float(np.ptp(time)) if time.size else 0.0
    if run.peaks_only:
        raise InputError("it has peaks only")
    if run.copied:
        raise InputError("it is a copy of another run")
    if not run.moves:
        raise InputError("nothing moves in it")
    if run.kind == "forced" and run.drive is None and run.pivot is None:
        raise InputError("neither its drive nor its pivot is given")
    if run.kind == "forced" and (time.size < FEWEST or seconds < swing):
        raise InputError(
            f"it is too short: {counted(time.size, 'sample')} over {seconds:.3g} s; {FEWEST} over "
            f"{swing:.3g} s, one swing, are needed"
        )


def as_json(comparison: Comparison) -> dict[str, Any]:
    """Return the JSON object of ``pendmap compare``; a time beyond a record's end is infinite."""
    return {
        "experiment": str(comparison.experiment.path),
        "doubts": doubts(comparison.experiment, *(one.run for one in comparison.every)),
        "runs": [
            {
                "name": one.run.name,
                "kind": one.run.kind,
                "hold_out": one.run.hold_out,
                "samples": int(one.run.trusted.sum()),
                "noise": one.sigma,
                "rms": one.rms,
                **(_forced(one) if isinstance(one, ForcedComparison) else _free(one)),
                "findings": [finding.text for finding in one.run.findings],
            }
            for one in comparison.every
        ],
        "left_out": [{"name": name, "why": why} for name, why in comparison.left_out],
        "findings": [finding.text for finding in comparison.experiment.findings],
    }


def _free(one: RunComparison) -> dict[str, Any]:
    errors = one.errors
    return {
        "start": {"theta": one.start[0], "velocity": one.start[1]},
        "period_rms_percent": None if errors is None else errors.period_rms,
        "peak_rms_percent": None if errors is None else errors.peak_rms,
        "table1": [
            {
                "what": row.what,
                "asked": row.asked,
                "measured": row.measured,
                "error_percent": row.errors.get(MODEL),
            }
            for row in one.table.rows
        ],
        "table1_left_out": one.table.left_out or next(iter(one.table.lost.values()), None),
        "periods": [] if errors is None else _pairs(errors.period_time, errors.period_error),
        "peaks": [] if errors is None else _pairs(errors.peak, errors.peak_error),
    }


def _pairs(places: Floats, errors: Floats) -> list[dict[str, float]]:
    pairs = zip(places.tolist(), errors.tolist(), strict=True)
    return [{"at": at, "error_percent": error} for at, error in pairs]


def _forced(one: ForcedComparison) -> dict[str, Any]:
    start, drive = one.start, one.run.drive
    return {
        "windows": one.windows,
        "start": {"theta": start.theta, "velocity": start.velocity},
        "start_stderr": dict(zip(("theta", "velocity"), start.stderr, strict=True)),
        "drive": None if drive is None else dict(drive),
        "phi": None
        if one.phase is None
        else {"value": one.phase.value, "stderr": one.phase.stderr},
        "members": one.ensemble.members,
        "members_lost": one.lost,
        "spread": one.ensemble.spread,
        "statistics": [
            {
                "what": statistic.name,
                "unit": statistic.unit or "1",
                "measured": statistic.measured,
                "median": statistic.median,
                "ci95": statistic.ci95,
                "chance": statistic.chance,
            }
            for statistic in one.statistics
        ],
        "steady": None if one.steady is None else _steady(one.steady),
    }


def _cycle(cycle: Cycle) -> dict[str, Any]:
    return {"name": cycle.name, "kind": cycle.attractor.kind, "n": cycle.n, "w": cycle.w}


def _steady(steady: Steady) -> dict[str, Any]:
    return {
        **_cycle(steady.measured),
        "cycles": steady.cycles,
        "amplitude": steady.measured.amplitude,
        "model": [_cycle(one.cycle) | {"share": one.share} for one in steady.reached],
        "rms_theta": steady.rms,
        "rms_velocity": steady.rms_velocity,
        "amplitude_error_percent": 100 * steady.overestimate,
    }


def _name(run: Run) -> str:
    return run.name + (" (held out)" if run.hold_out else "")


def _free_table(runs: Sequence[RunComparison]) -> Table:
    """Return header and rows of the table of free decays."""
    head = ["run", "rms (rad)", "noise (rad)", "rms / noise", "periods, rms", "peaks, rms"]
    rows = []
    for one in runs:
        errors = one.errors
        rows.append(
            [
                _name(one.run),
                f"{one.rms:.4g}",
                f"{one.sigma:.3g}",
                f"{one.rms / one.sigma:.3g}",
                "" if errors is None else percent(errors.period_rms),
                "" if errors is None else percent(errors.peak_rms),
            ]
        )
    return head, rows


def _forced_table(runs: Sequence[ForcedComparison]) -> Table:
    """Return header and rows of the table of statistics of forced runs."""
    head = ["forced run", "record", "model", "95 % of its ensemble", "p-value"]
    rows = []
    for one in runs:
        rows.append([_name(one.run), "", "", "", ""])
        for statistic in one.statistics:
            low, high = statistic.ci95
            rows.append(
                [
                    f"  {statistic.name}" + (f" ({statistic.unit})" if statistic.unit else ""),
                    written(statistic, statistic.measured),
                    written(statistic, statistic.median),
                    f"{written(statistic, low)} to {written(statistic, high)}",
                    f"{statistic.chance:.2g}",
                ]
            )
    return head, rows


def written(of: Statistic, value: float, digits: int = 4) -> str:
    """Return a value of a statistic as text."""
    if not math.isfinite(value):
        return "not yet"
    return f"{value:.0f}" if not of.unit or abs(value) >= 10**digits else f"{value:.{digits}g}"


def in_short(comparison: Comparison) -> list[str]:
    """Return the doubts about the records, and how many runs the model describes."""
    every = comparison.every
    others = [one.run.name for one in every if one.rms > FITS * one.sigma]
    count = f"{len(every) - len(others)} of {counted(len(every), 'run')}"
    text = f"The model describes {count} (residual up to {FITS:g} times the noise)"
    text += f"; not {', '.join(others)}." if others else "."
    return [*doubt_lines(comparison.experiment, *(one.run for one in every)), text]


def _lines(comparison: Comparison) -> Iterator[str]:
    """Yield the lines printed with the tables: in short, table 1, quality of fit, findings."""
    yield from in_short(comparison)
    for one in comparison.runs:
        for row in one.table.rows:
            unit = _UNITS[row.what]
            error = row.errors.get(MODEL, math.nan)
            text = "the model rests by then" if math.isnan(error) else f"error {percent(error)}"
            yield f"{one.run.name}: {row.what} of {row.measured:.4g} {unit}: {text}"
        if one.table.left_out:
            yield f"{one.run.name}: {one.table.left_out}"
        for reason in one.table.lost.values():
            yield f"{one.run.name}: periods and peaks are not compared: {reason}"
    for forced in comparison.forced:
        yield from _forced_lines(forced)
    for name, why in comparison.left_out:
        yield f"{name}: not compared: {why}"
    yield from finding_lines(comparison.experiment, *(one.run for one in comparison.every))


def _forced_lines(one: ForcedComparison) -> Iterator[str]:
    """Yield the lines on a run's residual, steady state and improbable statistics."""
    name = one.run.name
    yield (
        f"{name}: in {counted(one.windows, 'window')} of up to three swings the residual is "
        f"{one.rms:.3g} rad, {one.rms / one.sigma:.3g} times the noise"
    )
    if one.phase is not None:
        yield f"{name}: the drive's phase is not given: {one.phase.value:.4g} rad was fitted"
    if one.steady is not None:
        yield f"{name}: {_steady_line(one.steady)}"
    for statistic in one.unlike:
        unit = f" {statistic.unit}" if statistic.unit and math.isfinite(statistic.measured) else ""
        yield (
            f"{name}: {statistic.name}: {written(statistic, statistic.measured)}{unit} is "
            f"improbable under the model (p-value {statistic.chance:.2g})"
        )
    if one.lost:
        yield f"{name}: {one.lost} of {one.ensemble.members} members overflowed"


def _steady_line(steady: Steady) -> str:
    """Return the text on the steady states of a record and of the model."""
    ends = [
        f"{one.cycle.name} from {percent(100 * one.share)} of the starts" for one in steady.reached
    ]
    share = sum(one.share for one in steady.reached)
    if share < 1 - 1e-9:
        ends.append(f"no cycle from {percent(100 * (1 - share))}")
    head = f"settles on {steady.measured.name}; the model on {', '.join(ends)}"
    if steady.model is None:
        return f"{head}: not on the measured one"
    more = ""
    if math.isfinite(steady.overestimate):
        more = f", in amplitude by {100 * steady.overestimate:+.2g} %"
    return (
        f"{head}. Over a cycle they differ by {steady.rms:.2g} rad and {steady.rms_velocity:.2g} "
        f"rad/s rms{more}"
    )
