"""A model against records that it was not fitted to: comparison, JSON and text."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.comparison import forced_summary
from pendmap.comparison.forced import FEWEST, Ensemble, ForcedComparison, compare_forced
from pendmap.errors import (
    MOST_THREADS,
    FitDiverged,
    InputError,
    check_callable,
    check_type,
    check_whole,
)
from pendmap.formatting import Estimate, Readable, counted, percent
from pendmap.identification.fit import fit_runs
from pendmap.identification.methods.base import Identification
from pendmap.identification.methods.trajectory import OFFSET
from pendmap.identification.peaks import find_peaks
from pendmap.identification.readings import as_fit_run, reading_of_run
from pendmap.identification.runs import rig_of
from pendmap.identification.table1 import table_of_run
from pendmap.model import Rig
from pendmap.records.experiment import Experiment
from pendmap.records.summary import doubts, doubts_said, findings_said

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from pendmap.identification.peaks import Peaks
    from pendmap.identification.table1 import PeakErrors, Table1
    from pendmap.records import Run

    Floats = NDArray[np.float64]


MODEL = "model"  # Name of the model in table 1


@dataclasses.dataclass(frozen=True, repr=False)
class RunComparison:
    """A model beside one free decay.

    Parameters
    ----------
    run : Run
        The record.
    sigma : float
        Its noise, rad.
    start : (float, float)
        Angle (rad) and velocity (rad/s) at its first free sample, from which the model comes
        nearest.
    curve : ndarray, shape (2, N)
        Angle and velocity of the model at each sample.
    residual : ndarray, shape (N,)
        What the sensor read less the model's reading, rad; 0 where a sample does not count.
    rms : float
        Of the residual over the samples that count, rad.
    peaks : Peaks
        Of the record.
    table : Table1
        Table 1 and figure 7, with one column; the model starts at the first peak, as measured.
    """

    run: Run
    sigma: float
    start: tuple[float, float]
    curve: Floats
    residual: Floats
    rms: float
    peaks: Peaks
    table: Table1

    def __repr__(self) -> str:
        held = ", held out" if self.run.hold_out else ""
        return (
            f"<RunComparison {self.run.name}{held}: rms {self.rms:.3g} rad, noise "
            f"{self.sigma:.3g} rad>"
        )

    @property
    def errors(self) -> PeakErrors | None:
        """Errors of periods and peaks; none where there are too few."""
        return self.table.errors.get(MODEL)


@dataclasses.dataclass(frozen=True, repr=False)
class Comparison(Readable):
    """A model beside an experiment.

    Parameters
    ----------
    model : Rig
        With its effects, those on the reading included.
    experiment : Experiment
        The records.
    runs : tuple of RunComparison
        One for each free decay.
    forced : tuple of ForcedComparison
        One for each forced run.
    left_out : tuple of (str, str)
        Name of each other run, and why it is not compared.
    """

    model: Rig
    experiment: Experiment
    runs: tuple[RunComparison, ...]
    forced: tuple[ForcedComparison, ...] = ()
    left_out: tuple[tuple[str, str], ...] = ()

    def __repr__(self) -> str:
        every = self.every
        worst = max(one.rms / one.sigma for one in every)
        each = f"rms up to {worst:.3g} times the noise"
        runs = counted(len(every), "run")
        return f"<Comparison {self.experiment.path.name}: {runs}, {each}; {self.model.title}>"

    @property
    def every(self) -> tuple[RunComparison | ForcedComparison, ...]:
        """All runs that were compared, free decays first."""
        return (*self.runs, *self.forced)

    def said(self) -> tuple[list[tuple[list[str], list[list[str]]]], list[str]]:
        """Return the tables and the lines that ``pendmap compare`` prints."""
        return tables(self), list(as_text(self))


def compare(
    model: Rig,
    experiment: Experiment,
    *,
    ensemble: Ensemble | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Comparison:
    """Compare a model with every run of an experiment.

    No parameter of the model is adapted. The residual of a free decay is least over the angle and
    velocity of its first free sample, known only to the noise; periods and peaks are those of a
    motion from the first peak as it was measured.

    A forced run may be chaotic, and two chaotic paths diverge however good the model is. It is
    compared with an ensemble of simulated records over a neighbourhood of its start, by the wells
    visited, escapes between them, the angle covered, the time to settle and the greatest velocity;
    where it ends on a steady state also with the cycle that the model ends on, at the same phase of
    the drive. Its residual is taken in windows of up to three swings with a state each.

    Parameters
    ----------
    model : Rig
        In SI; :func:`pendmap.load_model` reads it.
    experiment : Experiment
        As for :func:`pendmap.read_experiment`.
    ensemble : Ensemble, optional
        How many starts a forced run has, and how far apart.
    threads : int, optional
        Number of threads; by default one a processor.
    progress : callable, optional
        Called now and then with the members done and in all of a forced run.

    Raises
    ------
    InputError
        If no run has samples in which something moves, and a drive that is known where it is
        forced.
    KeyboardInterrupt
        After Ctrl-C.
    """
    check_type("model", model, Rig, "pendmap.load_model('model.toml') in SI")
    check_type("experiment", experiment, Experiment, "pendmap.read_experiment('folder')")
    if ensemble is not None:
        check_type("ensemble", ensemble, Ensemble, "pendmap.Ensemble(members=400)")
    if threads is not None:
        check_whole("threads", threads, 1, MOST_THREADS)
    check_callable("progress", progress)
    sampled = [run for run in experiment.runs if not run.peaks_only]
    if not sampled:
        raise InputError(f"{experiment.path}: one run or more must have samples, none has")
    experiment.refuse_still(sampled)
    many = ensemble or Ensemble()
    free: list[RunComparison] = []
    forced: list[ForcedComparison] = []
    out: list[tuple[str, str]] = []
    for run in experiment.runs:
        why = _why_not(model, run)
        if not why:
            try:
                if run.kind == "free":
                    free.append(_compared(model, run))
                else:
                    forced.append(
                        compare_forced(model, run, many, threads=threads, progress=progress)
                    )
            except (FitDiverged, InputError) as error:  # the others are compared all the same
                why = str(error)
        if why:
            out.append((run.name, why))
    if not free and not forced:
        said = "; ".join(": ".join(each) for each in out)
        raise InputError(f"{experiment.path}: no run can be compared: {said}")
    return Comparison(model, experiment, tuple(free), tuple(forced), tuple(out))


def _why_not(model: Rig, run: Run) -> str:
    """Return why a run cannot be compared with a model; empty where it can."""
    time, swing = run.time[run.trusted], math.tau / model.w0
    seconds = float(np.ptp(time)) if time.size else 0.0
    why = ""
    if run.peaks_only:
        why = "it holds peaks alone"
    elif run.copied:
        why = "it is a copy of another run"
    elif not run.moves:
        why = "nothing moves in it"
    elif run.kind == "forced" and run.drive is None and run.pivot is None:
        why = "what drives it is not known"
    elif run.kind == "forced" and (time.size < FEWEST or seconds < swing):
        why = (
            f"it is too short: {counted(time.size, 'sample')} over {seconds:.3g} s; {FEWEST} over "
            f"{swing:.3g} s, one swing, are needed"
        )
    return why


def _compared(model: Rig, run: Run) -> RunComparison:
    reading = reading_of_run(run)
    given = as_fit_run(run, reading)
    model = rig_of(given, model)  # with the drive of the run
    fit = fit_runs([given], model, free=())
    peaks = find_peaks(run.time, run.theta, sigma=reading.sigma, trusted=run.trusted)
    estimates = {name: Estimate(getattr(model, name)) for name in ("w0", "c_over_m", "Tr")}
    for effect in model.effects:
        if effect.name == OFFSET:
            estimates["offset"] = Estimate(effect.parameters["d"])
    return RunComparison(
        run=run,
        sigma=reading.sigma,
        start=fit.windows[0][3:],
        curve=fit.curves[0],
        residual=fit.residuals[0],
        rms=fit.rms,
        peaks=peaks,
        table=table_of_run(run, peaks, {MODEL: Identification(MODEL, estimates, model=model)}),
    )


FITS: Final = 1.1
"""Rms over noise up to which a model describes a record: the noise is known to a few percent."""


def as_json(comparison: Comparison) -> dict[str, Any]:
    """Return the JSON object of ``pendmap compare``."""
    return {
        "experiment": str(comparison.experiment.path),
        "doubts": doubts(comparison.experiment, *(one.run for one in comparison.every)),
        "runs": [
            *(_run(run) for run in comparison.runs),
            *(forced_summary.as_json(run) for run in comparison.forced),
        ],
        "left_out": [{"name": name, "why": why} for name, why in comparison.left_out],
        "findings": [found.text for found in comparison.experiment.findings],
    }


def _run(one: RunComparison) -> dict[str, Any]:
    errors = one.errors
    return {
        "name": one.run.name,
        "kind": one.run.kind,
        "hold_out": one.run.hold_out,
        "samples": int(one.run.trusted.sum()),
        "noise": one.sigma,
        "rms": one.rms,
        "start": {"theta": one.start[0], "velocity": one.start[1]},
        "period_rms_percent": None if errors is None else errors.period_rms,
        "peak_rms_percent": None if errors is None else errors.peak_rms,
        "table1": [
            {
                "what": row.what,
                "asked": row.asked,
                "measured": row.measured,
                "error_percent": next(iter(row.errors.values()), None),
            }
            for row in one.table.rows
        ],
        "table1_left_out": one.table.left_out or next(iter(one.table.lost.values()), None),
        "periods": [] if errors is None else _pairs(errors.period_time, errors.period_error),
        "peaks": [] if errors is None else _pairs(errors.peak, errors.peak_error),
        "findings": [found.text for found in one.run.findings],
    }


def _pairs(places: Floats, errors: Floats) -> list[dict[str, float]]:
    pairs = zip(places.tolist(), errors.tolist(), strict=True)
    return [{"at": at, "error_percent": error} for at, error in pairs]


def tables(comparison: Comparison) -> list[tuple[list[str], list[list[str]]]]:
    """Return heads and rows of the tables of free decays and of forced runs."""
    rows = []
    for one in comparison.runs:
        errors = one.errors
        rows.append(
            [
                one.run.name + (" (held out)" if one.run.hold_out else ""),
                f"{one.rms:.4g}",
                f"{one.sigma:.3g}",
                f"{one.rms / one.sigma:.3g}",
                "" if errors is None else percent(errors.period_rms),
                "" if errors is None else percent(errors.peak_rms),
            ]
        )
    head = ["run", "rms (rad)", "noise (rad)", "rms / noise", "periods, rms", "peaks, rms"]
    both = [(head, rows), forced_summary.table(comparison.forced)]
    return [table for table in both if table[1]]


def as_text(comparison: Comparison) -> Iterator[str]:
    """Yield the lines beside the tables: doubts first, then table 1, the fit, findings."""
    runs = [one.run for one in comparison.every]
    yield from doubts_said(comparison.experiment, *runs)
    for one in comparison.runs:
        for row in one.table.rows:
            unit = "s" if row.what == "period" else "rad"
            error = next(iter(row.errors.values()), math.nan)
            said = "the model rests by then" if math.isnan(error) else f"error {percent(error)}"
            yield f"{one.run.name}: {row.what} of {row.measured:.4g} {unit}: {said}"
        if one.table.left_out:
            yield f"{one.run.name}: {one.table.left_out}"
        for reason in one.table.lost.values():
            yield f"{one.run.name}: periods and peaks are not compared: {reason}"
        if one.rms > FITS * one.sigma:
            yield (
                f"{one.run.name}: the residual is {one.rms / one.sigma:.3g} times the noise: "
                "something is missing in the model"
            )
    for forced in comparison.forced:
        yield from forced_summary.lines(forced, FITS)
    for name, why in comparison.left_out:
        yield f"{name}: not compared: {why}"
    yield from findings_said(comparison.experiment, *runs)
