"""Comparison of a model with an experiment's runs, with its JSON and text."""

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
from pendmap.records.summary import doubt_lines, doubts, finding_lines

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pendmap.identification.peaks import Peaks
    from pendmap.identification.table1 import PeakErrors, Table1
    from pendmap.records import Run
    from pendmap.signal import Floats


MODEL = "model"  # Name of the model in table 1


@dataclasses.dataclass(frozen=True, repr=False)
class RunComparison:
    """Comparison of a model with one free decay.

    Parameters
    ----------
    run : Run
        The record.
    sigma : float
        Noise of the record, rad.
    start : (float, float)
        Fitted angle (rad) and velocity (rad/s) at the first free sample.
    curve : ndarray, shape (2, N)
        Angle and velocity of the model at each sample, rad and rad/s.
    residual : ndarray, shape (N,)
        Measured reading less the model's, rad; 0 at excluded samples.
    rms : float
        Root mean square residual of the included samples, rad.
    peaks : Peaks
        Peaks of the record.
    table : Table1
        Table 1 and figure 7, with one column; the model starts at the first measured peak.
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
        """Errors of periods and peaks; None if there are too few."""
        return self.table.errors.get(MODEL)


@dataclasses.dataclass(frozen=True, repr=False)
class Comparison(Readable):
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

    def text_parts(self) -> tuple[list[tuple[list[str], list[list[str]]]], list[str]]:
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
    experiment : Experiment
        Records, from :func:`pendmap.read_experiment`.
    ensemble : Ensemble, optional
        Number and spread of the initial states for a forced run.
    threads : int, optional
        Number of threads; by default one per processor.
    progress : callable, optional
        Called repeatedly with the number of members done and in all, for each forced run.

    Raises
    ------
    InputError
        If no run can be compared: one needs samples with motion, a forced one also a known drive.
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
            except (FitDiverged, InputError) as error:  # the other runs are still compared
                why = str(error)
        if why:
            out.append((run.name, why))
    if not free and not forced:
        said = "; ".join(": ".join(each) for each in out)
        raise InputError(f"{experiment.path}: no run can be compared: {said}")
    return Comparison(model, experiment, tuple(free), tuple(forced), tuple(out))


def _why_not(model: Rig, run: Run) -> str:
    """Return why a run cannot be compared with a model; empty if it can."""
    time, swing = run.time[run.trusted], math.tau / model.w0
    seconds = float(np.ptp(time)) if time.size else 0.0
    why = ""
    if run.peaks_only:
        why = "it has peaks only"
    elif run.copied:
        why = "it is a copy of another run"
    elif not run.moves:
        why = "nothing moves in it"
    elif run.kind == "forced" and run.drive is None and run.pivot is None:
        why = "neither its drive nor its pivot is given"
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
"""Rms residual over noise up to which a model fits; the noise is known to a few percent."""


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
    """Return headers and rows of the tables of free decays and of forced runs."""
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
    """Yield the lines printed with the tables: doubts, table 1, quality of fit, findings."""
    runs = [one.run for one in comparison.every]
    yield from doubt_lines(comparison.experiment, *runs)
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
                "the model does not describe this run"
            )
    for forced in comparison.forced:
        yield from forced_summary.lines(forced, FITS)
    for name, why in comparison.left_out:
        yield f"{name}: not compared: {why}"
    yield from finding_lines(comparison.experiment, *runs)
