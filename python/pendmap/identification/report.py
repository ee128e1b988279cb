"""Result of an identification, with its text and JSON."""

from __future__ import annotations

import dataclasses
from collections import Counter
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.formatting import counted, estimate_text, interval, percent
from pendmap.identification.engineering import lines_of, quantities, swing_amplitude
from pendmap.identification.methods.trajectory import DRAG, UNFIT, identification_of
from pendmap.identification.parameters import OFFSET, OPPOSING, SENSOR
from pendmap.identification.results import FitResult, Followed
from pendmap.model.labels import LABELS, QUANTITIES
from pendmap.records.summary import doubts, finding_lines

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from pendmap.formatting import Estimate
    from pendmap.identification.methods.base import Identification
    from pendmap.identification.methods.trajectory import JointFit
    from pendmap.identification.peaks import Peaks
    from pendmap.identification.results import Covariance
    from pendmap.identification.table1 import Table1
    from pendmap.model import Rig
    from pendmap.records import Experiment, Run

COLUMNS: Final = {
    "w0": "w0 (rad/s)",
    "c_over_m": "c/m (1/s)",
    "zeta": "zeta",
    "Tr": "Tr (rad/s^2)",
    "theta_r": "theta_r (rad)",
    "offset": "offset (rad)",
}
"""Columns of the table of methods and their headers; effects' parameters follow."""


@dataclasses.dataclass(frozen=True, repr=False)
class IdentificationReport(FitResult):
    """Results of several methods for an experiment.

    Parameters
    ----------
    experiment : Experiment
        The records.
    run : Run
        Free decay used by the methods of peaks and in figures.
    peaks : Peaks
        Peaks of this run.
    methods : mapping of str to Identification
        Results by method, the best one first.
    joint : JointFit or None
        Fit by the trajectory method; None if it was not requested or cannot be applied.
    table : Table1
        Table 1 and figure 7 of the decay.
    with_drag : JointFit or None
        Fit with quadratic drag, if the residual of ``joint`` exceeds the noise and no effects were
        given.
    asked : tuple of str
        Names of the effects that were given.
    """

    KIND: ClassVar[str] = "identification"

    experiment: Experiment
    run: Run
    peaks: Peaks
    methods: dict[str, Identification]
    joint: JointFit | None
    table: Table1
    with_drag: JointFit | None = None
    asked: tuple[str, ...] = ()

    def __repr__(self) -> str:
        best = "no method gives a model" if self.sound is None else self.sound.short
        more = f"; {counted(len(self.methods), 'method')}, {counted(len(self.runs), 'run')}"
        return f"<IdentificationReport {self.run.name}: {best}{more}>"

    def text_parts(self) -> tuple[list[tuple[list[str], list[list[str]]]], list[str]]:
        """Return the tables and lines that ``pendmap identify`` prints."""
        return [methods_table(self), table1_table(self)], as_text(self)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Reasons to doubt records, parameters and model, as ``pendmap identify`` prints them."""
        return tuple(dict.fromkeys([*foremost(self), *(self.sound.warnings if self.sound else ())]))

    @property
    def parameters(self) -> Mapping[str, Estimate]:
        """Parameters of the best method; none if no method gives a model."""
        return {} if self.sound is None else self.sound.parameters

    @property
    def readings(self) -> pd.DataFrame:
        """All readings of the fitted runs, one below the other.

        ``time_s`` on the clock of the run, ``reading_rad``, ``fit_rad``, ``residual_rad`` and
        ``run``; of a gyroscope ``reading_rad_per_s`` and so on. Fit and residual are nan where
        a reading is not fitted. InputError is raised without a fit of whole records.
        """
        import pandas as pd  # noqa: PLC0415 (where it is needed)

        fit, _, runs = self.followed()
        parts = []
        for run, left in zip(runs, fit.residuals, strict=True):
            gain, unit = (1.0, "rad") if run.gyroscope is None else (run.gyroscope.w0, "rad/s")
            residual = np.where(run.trusted, gain * left, np.nan)
            columns = {"reading": run.read, "fit": run.read - residual, "residual": residual}
            named = {
                f"{name}_{unit.replace('/', '_per_')}": values for name, values in columns.items()
            }
            parts.append(pd.DataFrame({"time_s": run.time, **named, "run": run.name}))
        return pd.concat(parts, ignore_index=True)

    @property
    def largest_swing(self) -> float:
        """Amplitude of the largest swing of :attr:`run`, rad; pi where it rotates."""
        size = np.abs(self.peaks.amplitude)
        if self.joint is not None:
            size = swing_amplitude(self.joint.fit.curves[0], self.joint.fit["w0"])
        return min(float(np.nanmax(size)), np.pi) if np.isfinite(size).any() else np.nan

    @property
    def quantities(self) -> Mapping[str, Estimate]:
        """Numbers of the trade with errors, by name; those that are not known are left out.

        Of small swings ``frequency_hz = w0 / (2 pi)`` and ``period_s``. Of the viscous damping
        alone ``zeta = c / (2 m w0)``, ``log_decrement = 2 pi zeta / sqrt(1 - zeta^2)`` and
        ``time_constant_s = 2 m / c`` of the amplitude. ``Q = 2 pi E / loss`` of a cycle at half of
        :attr:`largest_swing`, by damping, friction and quadratic drag together. The dead band in
        which friction holds the pendulum, ``asin(Tr / w0^2)``, as ``dead_band_rad`` and
        ``dead_band_deg``. ``friction_n_m = J Tr`` and ``viscous_n_m_s = J c / m`` with the moment
        of inertia ``J`` about the pivot: ``inertia`` of ``[rig]``, kg m^2, or ``m g l / w0^2`` of
        its ``mass``, kg, and ``length``, m, from the pivot to the centre of mass.
        """
        if self.sound is None:
            return {}
        known = self.experiment.known, self.experiment.gravity
        return quantities(self.sound, self.largest_swing / 2, *known)

    @property
    def joint_covariance(self) -> Covariance | None:
        """Covariance of the best method."""
        return self.best.covariance

    def followed(self) -> Followed:
        """Return the fit of the trajectory method."""
        if self.joint is None:
            raise InputError(f"{self.run.name}: the trajectory method must have fitted it")
        return Followed(self.joint.fit, self.joint.given, self.joint.runs)

    @property
    def sound(self) -> Identification | None:
        """Result of the first method that gives a model; None if there is none.

        Other methods do not replace a search that did not converge, or a fit of effects.
        """
        first = next(iter(self.methods.values()))
        if not first.sound and (self.asked or not first.converged):
            return None
        return next((result for result in self.methods.values() if result.sound), None)

    @property
    def best(self) -> Identification:
        """Result of :attr:`sound`; InputError is raised if there is none."""
        if self.sound is not None:
            return self.sound
        first = next(iter(self.methods.values()))
        reasons = "; ".join(first.warnings)
        if not first.converged:
            more = "" if first.applicable else f": {reasons}"
            raise InputError(
                f"{self.run.name}: must be the record of a free decay, got one on which the fit of "
                f"the {first.method} did not converge{more}"
            )
        if self.asked:
            names = ", ".join(self.asked)
            raise InputError(f"{self.run.name}: {names} could not be fitted: {reasons}")
        raise InputError(f"{self.run.name}: no method can be applied: {reasons}")

    @property
    def runs(self) -> tuple[Run, ...]:
        """Runs used by any method."""
        return (self.run,) if self.joint is None else self.joint.runs

    @property
    def passed_over(self) -> str:
        """Text on the preferred method that failed, with the reason; empty if none failed."""
        first = next(iter(self.methods.values()))
        if first.sound or self.sound is None:
            return ""
        return f"{first.method} cannot be applied: the model is that of {self.sound.method}"

    @property
    def model(self) -> Rig:
        """Model of the best method, with its effects, and in its notes their covariance.

        ``[covariance]`` has ``names``, ``matrix`` and the 95 % intervals ``ci95`` of all jointly
        fitted parameters, both widened if the residual exceeds the noise.
        """
        best, notes = self.best, dict[str, Any]()
        if best.covariance is not None:
            names, matrix = best.covariance
            # The bias of a sensor does not belong to the pendulum.
            written = {name: name for name in names if name.partition("[")[0] != SENSOR}
            if "offset" in written:
                written["offset"] = f"{OFFSET}.d"
            places = [names.index(name) for name in written]
            bounds = {name: e.ci95 for name, e in best.estimates.items() if name in written}
            notes["covariance"] = {
                "names": [*written.values()],
                "matrix": matrix[np.ix_(places, places)].tolist(),
                "ci95": {written[n]: list(ci95) for n, ci95 in bounds.items() if ci95 is not None},
            }
        model = best.model or dataclasses.replace(best.rig, gravity=self.experiment.gravity)
        return dataclasses.replace(model, notes=notes)


def left_out(experiment: Experiment, read: Sequence[Run]) -> str:
    """Return the text on the runs that were used and not used; empty if all were used."""
    held_too = any(run.hold_out for run in read)  # then being held out is no reason

    def reason(run: Run) -> str:
        if run.copied:
            return "copied"
        if run.hold_out and not held_too:
            return "held out"
        if run.kind == "forced":
            return "forced"
        if run.peaks_only:
            return "of peaks alone"
        return "held out" if run.hold_out else "shorter" if run.moves else "at rest"

    angles = {id(run.theta) for run in read}  # also of a run that is used in part
    reasons = Counter(reason(run) for run in experiment.runs if id(run.theta) not in angles)
    texts = [f"{count} {why}" for why, count in reasons.items()]
    return f"{counted(len(read), 'run')} read; not used: {', '.join(texts)}" if texts else ""


def as_json(report: IdentificationReport) -> dict[str, Any]:
    """Return the JSON object of ``pendmap identify``, without the paths of files."""
    run, best, known = report.run, report.sound, report.quantities
    return {
        "experiment": str(report.experiment.path),
        "run": run.name,
        "runs": run_entries(report),
        "noise": report.peaks.sigma,
        "best": None if best is None else best.method,
        "doubts": foremost(report),
        "quantities": {n: dataclasses.asdict(known[n]) if n in known else None for n in QUANTITIES},
        "q_amplitude_rad": report.largest_swing / 2 if "Q" in known else None,
        "methods": {name: _method(result) for name, result in report.methods.items()},
        "table1": [
            {"what": r.what, "asked": r.asked, "measured": r.measured, "errors_percent": r.errors}
            for r in report.table.rows
        ],
        "table1_left_out": report.table.left_out or None,
        "not_simulated": dict(report.table.lost),
        "rms": None if report.joint is None else report.joint.fit.rms,
        "with_drag": report.with_drag
        and {
            "rms": report.with_drag.fit.rms,
            "parameters": {n: e.value for n, e in report.with_drag.fit.estimates.items()},
        },
        "findings": [finding.text for _, finding in report.experiment.findings_of(report.runs)],
    }


def run_entries(report: IdentificationReport) -> list[dict[str, Any]]:
    """Return the JSON objects of the runs used; rms and noise are those of the joint fit."""
    entries: list[dict[str, Any]] = []
    for k, run in enumerate(report.runs):
        time, joint = run.time[run.trusted], report.joint
        left = None if joint is None else joint.fit.residuals[k][run.trusted]
        entries.append(
            {
                "name": run.name,
                "file": run.file,
                "lab_time_s": run.lab_time_s,
                "from_s": float(time[0]),
                "to_s": float(time[-1]),
                "samples": int(time.size),
                "rms": None if left is None else float((left**2).mean() ** 0.5),
                "noise": None if joint is None else joint.readings[k].sigma,
            }
        )
    return entries


def _method(result: Identification) -> dict[str, Any]:
    known = result.parameters
    every = {name: known.get(name) for name in (*COLUMNS, *known)}
    return {name: e and e.value for name, e in every.items()} | {
        "stderr": {name: e and e.stderr for name, e in every.items()},
        "ci95": {name: e and e.ci95 for name, e in every.items()},
        "warnings": list(result.warnings),
        "used": result.used,
        "applicable": result.applicable,
        "misfit": result.misfit,
    }


def as_text(report: IdentificationReport) -> list[str]:
    """Return the lines of the short text, intervals, all methods' warnings, and all findings."""
    best, lines = report.sound, list(in_short(report))
    for name, estimate in {} if best is None else best.parameters.items():
        if estimate.ci95 is not None:
            lines.append(f"  {name} = {estimate_text(estimate)}, 95 % in {interval(estimate)}")
    if report.table.left_out:
        lines.append(f"{report.run.name}: {report.table.left_out}")
    for name, result in report.methods.items():
        if result is not best and not report.peaks.lacking:
            lines += [f"{name}: {warning}" for warning in result.warnings]
        if name in report.table.lost:
            why = report.table.lost[name]
            lines.append(f"{name}: not simulated from the first peak: {why}")
    lines += finding_lines(report.experiment, *report.runs)
    return list(dict.fromkeys(lines))


def in_short(report: IdentificationReport) -> Iterator[str]:
    """Yield doubts about the records, the parameters in a line, and the data that they are from."""
    best = report.sound
    yield from (f"Warning: {text}" for text in foremost(report))
    if best is not None:
        further = {n: e for n, e in best.estimates.items() if n not in COLUMNS}
        texts = [f"{n} = {estimate_text(e)} {best.unit(n)}".rstrip() for n, e in further.items()]
        yield ", ".join([in_line(best.parameters), *texts])
        yield from lines_of(report.quantities, report.largest_swing / 2)
        yield f"{best.method}: {best.used}"
    runs_text = left_out(report.experiment, report.runs)
    if runs_text:
        yield runs_text
    yield from finding_lines(report.experiment, *report.runs, changes=True)
    yield from (f"Warning: {text}" for text in report.warnings[len(foremost(report)) :])
    if report.with_drag is not None and report.joint is not None:
        drag = identification_of(report.with_drag)
        name = next(n for n in drag.estimates if n.startswith(DRAG))
        yield (
            f"With {DRAG} ({name.partition('.')[2]} = {estimate_text(drag.estimates[name])}) the "
            f"residual is {report.with_drag.fit.rms:.3g} rad, {report.joint.fit.rms:.3g} without: "
            f"--effect {DRAG} fits it, diagnose looks for more"
        )


def in_line(known: Mapping[str, Estimate]) -> str:
    """Return the parameters that are said first, with symbols and units."""
    return ", ".join(
        f"{LABELS[name].symbol} = {estimate_text(known[name])} {LABELS[name].unit}"
        for name in ("w0", *OPPOSING)
        if name in known
    )


def foremost(report: IdentificationReport) -> list[str]:
    """Return doubts about records and model, and the text on a preferred method that failed."""
    best, other = report.sound, report.passed_over
    unfit = [text for text in (best.warnings if best else ()) if text.startswith(UNFIT)]
    return [*doubts(report.experiment, *report.runs), *unfit, *([other] if other else [])]


def methods_table(report: IdentificationReport) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of the table of methods."""
    best = report.sound
    extra = [] if best is None else [n for n in best.estimates if n not in COLUMNS]
    names = [*COLUMNS, *extra]
    rows = []
    for method, result in report.methods.items():
        known = result.parameters
        shown = [estimate_text(known[name]) if name in known else "" for name in names]
        if not result.applicable:
            shown = ["not applicable", *[""] * (len(names) - 1)]
        rows.append([method, *shown])
    return ["method", *COLUMNS.values(), *extra], rows


def table1_table(report: IdentificationReport) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of table 1: percent errors of each method's simulation."""
    rows = []
    for name, errors in report.table.errors.items():
        cells = [percent(row.errors[name]) or "at rest" for row in report.table.rows]
        rows.append([name, *cells, percent(errors.period_rms), percent(errors.peak_rms)])
    units = {"period": "s", "peak": "rad"}
    measured = [f"{r.what} {r.measured:.4g} {units[r.what]}" for r in report.table.rows]
    return ["error of the simulated", *measured, "periods, rms", "peaks, rms"], rows
