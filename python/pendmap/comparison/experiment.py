"""Comparison of a model with an experiment's runs, with its JSON and text."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np
import pandas as pd

from pendmap import errors
from pendmap.analysis.run import part
from pendmap.comparison.forced import FEWEST, Ensemble, ForcedComparison, compare_forced
from pendmap.comparison.free import MODEL, RunComparison, compare_free
from pendmap.errors import FitDiverged, InputError
from pendmap.files.saved import COLUMNS, Saved
from pendmap.formatting import counted, percent
from pendmap.model import Rig
from pendmap.records import experiment_of, summary

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from typing import Unpack

    from numpy.typing import ArrayLike

    from pendmap.comparison.itinerary import Cycle, Steady
    from pendmap.formatting import Table
    from pendmap.records import ByHand, Experiment, Run
    from pendmap.records.read import Records


_UNITS: Final = {"period": "s", "peak": "rad"}
FITS: Final = 1.1
"""Rms residual over noise up to which a model fits; the noise is known to a few percent."""


@dataclasses.dataclass(frozen=True, repr=False)
class Comparison(Saved):
    """Comparison of a model with an experiment."""

    KIND: ClassVar[str] = "comparison"
    ROWS = "row"

    model: Rig  #: The model with its effects, including those on the reading.
    experiment: Experiment  #: The records.
    runs: tuple[RunComparison, ...]  #: Comparisons with the free decays.
    forced: tuple[ForcedComparison, ...] = ()  #: Comparisons with the forced runs.
    #: Name of each other run, and the reason why it is not compared.
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
            Index ``run`` and ``quantity``; ``record``, ``model`` (of an ensemble the median),
            ``low`` and ``high`` (its 95 %), ``chance`` (two-sided p-value), ``error_percent``, nan
            where there is none, and ``unit``. ``residual`` has the noise and the rms.
        """
        rows = [
            {"run": one.run.name, "unit": ""} | row
            for one in self.every
            for row in _quantities(one)
        ]
        table = pd.DataFrame(rows, columns=[*COLUMNS[self.ROWS]]).set_index(["run", "quantity"])
        return table.astype({name: "string" if name == "unit" else float for name in table})

    def text_parts(self) -> tuple[list[Table], list[str]]:
        """Return the table and the lines that ``pendmap compare`` prints."""
        return [_table(self)], list(_lines(self))


def compare(  # noqa: PLR0913 (each is asked for by name)
    model: Rig,
    records: Records | Sequence[Records] | ArrayLike,
    theta: ArrayLike | None = None,
    *,
    ensemble: Ensemble | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], object] | None = None,
    **by_hand: Unpack[ByHand],
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
    records : path, DataFrame, Experiment, Run, or a sequence of these; array, shape (N,)
        As for :func:`pendmap.identify`; forced runs too.
    theta : array, shape (N,), optional
        Angles of one free decay, whose times are ``records``.
    ensemble : Ensemble, optional
        Number and spread of the initial states for a forced run.
    threads : int, optional
        Number of threads; by default one per processor.
    progress : callable, optional
        Called repeatedly with the number of members done and in all, for each forced run.
    **by_hand
        How records are read: :class:`pendmap.records.ByHand`.

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
    >>> round(pendmap.compare(rig, decay.time, angle).runs[0].rms, 4)
    0.001
    """
    errors.check_type("model", model, Rig, "pendmap.load_model('model.toml') in SI")
    experiment = experiment_of(records, theta, **by_hand)
    ensemble = Ensemble() if ensemble is None else ensemble
    errors.check_type("ensemble", ensemble, Ensemble, "pendmap.Ensemble(members=400)")
    if threads is not None:
        errors.check_whole("threads", threads, 1, errors.MOST_THREADS)
    errors.check_callable("progress", progress)
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
                shown = part(progress, driven.index(run.name), len(driven))
                forced.append(compare_forced(model, run, ensemble, threads, shown))
        except (FitDiverged, InputError) as error:  # the other runs are still compared
            out.append((run.name, str(error)))
    if not free and not forced:
        reasons = "; ".join(": ".join(pair) for pair in out)
        raise InputError(f"{experiment.path}: no run can be compared: {reasons}")
    return Comparison(model, experiment, tuple(free), tuple(forced), tuple(out))


def _check_comparable(model: Rig, run: Run) -> None:
    """Raise InputError with the reason why a run cannot be compared with a model."""
    time, swing, forced = run.time[run.trusted], math.tau / model.w0, run.kind == "forced"
    seconds = float(np.ptp(time)) if time.size else 0.0
    reasons = {
        "it has peaks only": run.peaks_only,
        "it is a copy of another run": run.copied,
        "nothing moves in it": not run.moves,
        "neither its drive nor its pivot is given": forced and not (run.drive or run.pivot),
        f"it is too short: {counted(time.size, 'sample')} over {seconds:.3g} s; {FEWEST} over "
        f"{swing:.3g} s, one swing, are needed": forced and (time.size < FEWEST or seconds < swing),
    }
    for reason, applies in reasons.items():
        if applies:
            raise InputError(reason)


def as_json(comparison: Comparison) -> dict[str, Any]:
    """Return the JSON object of ``pendmap compare``; a time beyond a record's end is infinite."""
    experiment, every = comparison.experiment, comparison.every
    return {
        "experiment": str(experiment.path),
        "doubts": summary.doubts(experiment, *(one.run for one in every)),
        "runs": [
            {
                "name": one.run.name,
                "kind": one.run.kind,
                "hold_out": one.run.hold_out,
                "samples": int(one.run.trusted.sum()),
                "noise": one.sigma,
                "rms": one.rms,
                "start": dict(zip(("theta", "velocity"), one.start, strict=True)),
                "quantities": [*_quantities(one)],
                **_fields(one),
                "findings": [finding.text for finding in one.run.findings],
            }
            for one in every
        ],
        "left_out": [{"name": name, "why": why} for name, why in comparison.left_out],
        "findings": [finding.text for finding in experiment.findings],
    }


def _fields(one: RunComparison | ForcedComparison) -> dict[str, Any]:
    """Return the JSON fields of a free decay or of a forced run."""
    if isinstance(one, RunComparison):
        return {
            "period_rms_percent": one.errors and one.errors.period_rms,
            "peak_rms_percent": one.errors and one.errors.peak_rms,
            "table1_left_out": one.left_out or None,
        }
    drive, phase = one.run.drive, one.phase
    return {
        "windows": one.windows,
        "start_stderr": dict(zip(("theta", "velocity"), one.start_stderr, strict=True)),
        "drive": drive and dict(drive),
        "phi": phase and {"value": phase.value, "stderr": phase.stderr},
        "members": one.ensemble.members,
        "spread": one.ensemble.spread,
        "steady": one.steady and _steady(one.steady),
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


def written(value: float, digits: int = 4) -> str:
    """Return a number as text: empty for NaN, ``not yet`` for an infinite time."""
    if not math.isfinite(value):
        return "" if math.isnan(value) else "not yet"
    return f"{value:.0f}" if abs(value) >= 10**digits else f"{value:.{digits}g}"


def _quantities(one: RunComparison | ForcedComparison) -> Iterator[dict[str, Any]]:
    """Yield what of a run is compared, as rows of the table."""
    yield {"quantity": "residual", "record": one.sigma, "model": one.rms, "unit": "rad"}
    if isinstance(one, ForcedComparison):
        for e in one.statistics:
            row = {"quantity": e.name, "record": e.measured, "model": e.median, "unit": e.unit}
            yield row | {"low": e.ci95[0], "high": e.ci95[1], "chance": e.chance}
        return
    if one.errors is not None:
        yield {"quantity": "periods, rms", "error_percent": one.errors.period_rms}
        yield {"quantity": "peaks, rms", "error_percent": one.errors.peak_rms}
    for r in one.table.rows:
        row = {"quantity": f"{r.what} {r.measured:.4g}", "record": r.measured}
        yield row | {"error_percent": r.errors.get(MODEL), "unit": _UNITS[r.what]}


def _table(comparison: Comparison) -> Table:
    """Return the table of all runs as text; of periods and peaks it has the model's error."""
    rows: list[list[str]] = []
    table = comparison.to_dataframe()
    for one in comparison.every:
        rows.append([one.run.name + (" (held out)" if one.run.hold_out else ""), "", "", "", ""])
        for row in table.loc[one.run.name].itertuples():
            name = f"  {row.Index}" + (f" ({row.unit})" if row.unit else "")
            model = percent(row.error_percent) or written(row.model)
            ends = "" if math.isnan(row.low) else f"{written(row.low)} to {written(row.high)}"
            rows.append([name, written(row.record), model, ends, written(row.chance, 2)])
    return ["run", "record", "model", "95 % of ensemble", "p-value"], rows


def in_short(comparison: Comparison) -> list[str]:
    """Return the doubts about the records, and how many runs the model describes."""
    every = comparison.every
    others = [one.run.name for one in every if one.rms > FITS * one.sigma]
    count = f"{len(every) - len(others)} of {counted(len(every), 'run')}"
    text = f"The model describes {count} (residual up to {FITS:g} times the noise)"
    text += f"; not {', '.join(others)}." if others else "."
    return [*summary.doubt_lines(comparison.experiment, *(one.run for one in every)), text]


def _lines(comparison: Comparison) -> Iterator[str]:
    """Yield the lines printed with the table: in short, steady states, findings."""
    yield from in_short(comparison)
    for one in comparison.runs:
        if one.left_out:
            yield f"{one.run.name}: {one.left_out}"
    for forced in comparison.forced:
        name = forced.run.name
        if forced.phase is not None:
            yield f"{name}: the drive's phase is not given: {forced.phase.value:.4g} rad was fitted"
        if forced.steady is not None:
            yield f"{name}: {_steady_line(forced.steady)}"
    for name, why in comparison.left_out:
        yield f"{name}: not compared: {why}"
    yield from summary.finding_lines(comparison.experiment, *(one.run for one in comparison.every))


def _steady_line(steady: Steady) -> str:
    """Return the text on the steady states of a record and of the model."""
    ends = [f"{one.cycle.name} from {percent(100 * one.share)}" for one in steady.reached]
    without = 1 - sum(one.share for one in steady.reached)
    ends += [f"no cycle from {percent(100 * without)}"] if without > 1e-9 else []  # noqa: PLR2004
    text = f"settles on {steady.measured.name}; the model on {', '.join(ends)} of the starts"
    if steady.model is None:
        return f"{text}: not on the measured one"
    text += (
        f". Over a cycle they differ by {steady.rms:.2g} rad and {steady.rms_velocity:.2g} rad/s"
    )
    wide = steady.overestimate
    return f"{text} rms" + (f", in amplitude by {100 * wide:+.2g} %" if math.isfinite(wide) else "")
