"""Identification from an experiment by all methods, and the resulting model file."""

from __future__ import annotations

import dataclasses
import itertools
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import (
    FitDiverged,
    InputError,
    check_callable,
    check_type,
    instruction_set,
    named,
)
from pendmap.identification.fit import refuse_astray
from pendmap.identification.methods.base import Identification
from pendmap.identification.methods.registry import BEST, apply_method, check_names, identify_peaks
from pendmap.identification.methods.trajectory import (
    DRAG,
    JointFit,
    fit_together,
    identification_of,
)
from pendmap.identification.peaks import Peaks, find_peaks
from pendmap.identification.report import IdentificationReport
from pendmap.identification.table1 import table1
from pendmap.identification.turning import TooShortError
from pendmap.model import Rig
from pendmap.model.effects import definition
from pendmap.records import experiment_of
from pendmap.records.summary import UNIT_FINDINGS, doubt_keys
from pendmap.signal.robust import from_first

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from typing import Unpack

    from numpy.typing import ArrayLike

    from pendmap.model import Effect
    from pendmap.records import ByHand, Experiment, Run
    from pendmap.records.read import Records


MISSES: Final = 1.2  # Residual over noise above which quadratic drag is tried
CLOSED: Final = 0.5  # Greatest share of the squared gap that quadratic drag may leave


def decay_of(experiment: Experiment) -> Run:
    """Return the longest free run that is not held out; raise InputError if there is none."""
    free = [run for run in experiment.runs if run.kind == "free" and not run.hold_out]
    if not free:
        raise InputError(
            f"{experiment.path}: must have a free decay, no run is free and not held out"
        )
    experiment.refuse_still(free)
    lengths = {k: float(np.ptp(r.time[r.trusted])) for k, r in enumerate(free) if r.moves}
    return free[max(lengths, key=lengths.__getitem__)]


def identify(  # noqa: PLR0913 (each is asked for by name)
    records: Records | Sequence[Records] | ArrayLike,
    theta: ArrayLike | None = None,
    *,
    methods: Iterable[str] | None = None,
    start: Rig | None = None,
    effects: Sequence[Effect | str] = (),
    progress: Callable[[int, int], object] | None = None,
    **by_hand: Unpack[ByHand],
) -> IdentificationReport:
    """Identify natural frequency, viscous damping and Coulomb friction by several methods.

    ``th'' + c_over_m th' + w0**2 sin th = -Tr sign(th')`` in SI, with further terms by ``effects``.
    The trajectory method fits all free runs that are not held out jointly, each with its own
    initial state; the other methods use the longest of these runs.

    Parameters
    ----------
    records : path, DataFrame, Experiment, Run, or a sequence of these; array, shape (N,)
        Free decays of one rig: files, folders, tables and arrays as for
        :func:`pendmap.read_experiment`, or what it returns; with ``theta`` the times.
    theta : array, shape (N,), optional
        Angles from the downward rest of one free decay.
    methods : iterable of str, optional
        Methods to apply, of :data:`pendmap.identification.METHODS`; by default all.
    start : Rig, optional
        Starting values and effects of the trajectory method; by default estimated from the record.
    effects : sequence of Effect or str
        Further effects, also by name, whose sizes the trajectory method fits.
    progress : callable, optional
        Called with the numbers of steps done and in all: one for each method, the peaks and the
        table.
    **by_hand
        How records are read: :class:`pendmap.records.ByHand`.

    Returns
    -------
    IdentificationReport
        Results by method, the fit of the whole records, and table 1.

    Raises
    ------
    InputError
        If a method or an effect is unknown, an effect acts on the drive or cannot be fitted, there
        is no free decay, its swings are impossible, or the best fit does not follow the records.
    OSError
        If a file cannot be read.

    References
    ----------
    Horton, Wiercigroch & Xu (2008), Phil. Trans. R. Soc. A, section 2.

    Examples
    --------
    >>> import numpy as np
    >>> import pendmap
    >>> rig = pendmap.Rig(w0=6.2, c_over_m=0.05, Tr=0.08)
    >>> time = np.arange(0, 30, 0.02)
    >>> decay = pendmap.simulate(rig, theta=2.0, velocity=0.0, t_eval=time)
    >>> angle = decay.theta.values + np.random.default_rng(0).normal(0, 1e-3, time.size)
    >>> report = pendmap.identify(time, angle)
    >>> report.to_dataframe().loc[["w0", "c_over_m", "Tr"], "value"].round(2).to_dict()
    {'w0': 6.2, 'c_over_m': 0.05, 'Tr': 0.08}
    >>> report.predict([0.0, 0.2]).round(2)
    array([2.  , 1.28])
    >>> float(report.correlation.loc["c_over_m", "Tr"].round(2))
    -0.98
    >>> round(float(report.residual["DataFrame"].std()), 4)
    0.001
    >>> again = pendmap.load(pendmap.save(report, "identify.nc"))
    >>> again.model == report.model
    True
    """
    experiment = experiment_of(records, theta, **by_hand)
    if start is not None:
        check_type("start", start, Rig, "pendmap.Rig(w0=6.2)")
    check_callable("progress", progress)
    names = check_names(methods)
    for effect in effects:
        name = effect if isinstance(effect, str) else effect.name
        if definition(name).group == "drive":
            raise InputError(
                f"effect {name} acts on the drive: it must be one that acts on free decays, of "
                "damping, torque or reading"
            )
    run = decay_of(experiment)
    if effects and (run.peaks_only or BEST not in names):
        got = "turning points alone" if run.peaks_only else f"the method {names[0]}"
        raise InputError(f"effects must be left out without a fit of every sample, got {got}")
    if run.peaks_only:
        peaks = Peaks.of(run.time[run.trusted], run.theta[run.trusted])
        results = identify_peaks(peaks, names)
        table = table1(peaks, results)
        return IdentificationReport(experiment, run, peaks, results, None, table)
    others = [name for name in names if name != BEST]
    steps, done = len(names) + 2, itertools.count(1)
    report = progress or (lambda _done, _total: None)
    sigma, joint, results = None, None, {}
    if BEST in names:
        freed = [] if effects or start is not None else _doubted_gain(experiment)
        joint, results[BEST] = _best(experiment, run, start, effects or freed)
        report(next(done), steps)
        if joint is not None:
            sigma = joint.readings[0].sigma
    peaks = find_peaks(run.time, run.theta, sigma=sigma, trusted=run.trusted)
    report(next(done), steps)
    time, first = from_first(run.time)
    record = time[run.trusted], run.theta[run.trusted]
    for name in others:
        result = apply_method(name, peaks.later(-first), record)
        results[name] = result.with_clock(run.clock_stderr)
        report(next(done), steps)
    table = table1(peaks, results)
    drag = None if joint is None or start is not None or effects else _with_drag(joint)
    report(next(done), steps)
    asked = tuple(effect if isinstance(effect, str) else effect.name for effect in effects)
    return IdentificationReport(experiment, run, peaks, results, joint, table, drag, asked)


def _with_drag(joint: JointFit) -> JointFit | None:
    """Return a fit with quadratic drag if the fit without it is poor and this closes its gap."""
    noise = float(np.mean([np.mean(reading.each) for reading in joint.readings]))
    if joint.added or joint.fit.rms < MISSES * noise:
        return None
    try:
        with_drag = fit_together(joint.runs, start=joint.fit.model, effects=[DRAG])
    except FitDiverged:
        return None
    drag = next(effect for effect in with_drag.fit.model.effects if effect.name == DRAG)
    opposes = min(drag.values) > 0
    gap, left = (one.fit.rms**2 - noise**2 for one in (joint, with_drag))
    return with_drag if opposes and left < CLOSED * gap else None


def _doubted_gain(experiment: Experiment) -> list[str]:
    """Return the effect of the sensor's gain if the periods disprove a gain of 1."""
    runs = [run for run in experiment.runs if run.kind == "free" and not run.hold_out]
    seen = {finding.what for _, finding in experiment.findings_of(runs)}
    return ["encoder_gain"] if "angle-scale" in seen else []


def _best(
    experiment: Experiment, run: Run, start: Rig | None, effects: Sequence[Effect | str]
) -> tuple[JointFit | None, Identification]:
    others = [r for r in experiment.runs if r.kind == "free" and not r.hold_out and r is not run]
    runs = [run, *(r for r in others if r.moves and not r.peaks_only)]
    known = {"gravity": experiment.gravity}
    if experiment.w0 is not None:
        known["w0"] = experiment.w0
    try:
        joint = fit_together(runs, start=start or known, effects=effects)
    except (TooShortError, FitDiverged) as error:
        short = isinstance(error, TooShortError)
        # Other methods can replace this one, but not for requested effects or starting values.
        if effects or not (short or start is None):
            raise
        return None, Identification(BEST, warnings=(str(error),), applicable=False, converged=short)
    certain = joint.fit.converged or len(runs) > 1
    # A wrong unit makes residuals meaningless.
    if certain and not doubt_keys(experiment, *runs) & UNIT_FINDINGS:
        refuse_astray(experiment.path, joint.given, joint.fit)
    return joint, dataclasses.replace(identification_of(joint), method=BEST)


def identified_model(report: IdentificationReport, command: str = "") -> Rig:
    """Return the model of the best method with the notes of its file.

    ``[covariance]`` is that of :attr:`IdentificationReport.model`; ``[provenance]`` has the method,
    the records with their SHA-256, the version, the command, and for a fit of the whole record its
    residual ``rms`` and the ``noise``, both in rad.

    Parameters
    ----------
    report : IdentificationReport
        Result of :func:`pendmap.identify`.
    command : str
        Command line for the provenance.

    Raises
    ------
    InputError
        If no method gives a model, the trajectory method did not converge, or a requested effect
        was not fitted.
    """
    best = report.best
    rms = noise = None
    if report.joint is not None and best.method == BEST:
        rms, noise = report.joint.fit.rms, report.joint.noise
    origin = provenance(report.experiment, report.runs, command, rms=rms, noise=noise)
    notes = {"provenance": origin | {"method": best.method}}
    with named(f"{report.run.name}: the result is no valid model"):
        model = report.model
        return dataclasses.replace(model, notes={**model.notes, **notes})


def provenance(
    experiment: Experiment,
    runs: Iterable[Run],
    command: str,
    *,
    rms: float | None = None,
    noise: float | None = None,
) -> dict[str, Any]:
    """Return the table ``[provenance]`` of a model file from records and their SHA-256.

    ``command`` is omitted if empty. ``rms`` is the residual, ``noise`` that of a reading, both rad:
    if rms is above 1.5 times the noise every map of the model has a warning.
    """
    table: dict[str, Any] = {"version": version("pendmap"), "simd": instruction_set()}
    if command:
        table["command"] = command
    table |= {name: x for name, x in (("rms", rms), ("noise", noise)) if x is not None}
    files = {run.file: run.sha256 or experiment.sha256.get(run.file, "") for run in runs}
    return table | {"records": [{"file": name, "sha256": code} for name, code in files.items()]}
