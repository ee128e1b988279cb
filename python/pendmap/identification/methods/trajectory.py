"""Trajectory method: fit of the equation of motion to the whole record of a free decay.

``th'' + c_over_m th' + w0**2 sin th = -Tr sign(th')``, with further terms by effects, is integrated
from release to rest, including stops, and all parameters are fitted jointly to all readings
(:mod:`pendmap.identification.fit`), without linearization or peaks.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import FitDiverged, InputError
from pendmap.formatting import Estimate, counted, moment
from pendmap.identification.fit import fit_runs
from pendmap.identification.methods.base import Identification
from pendmap.identification.parameters import OFFSET, OPPOSING, SENSOR, opposing
from pendmap.identification.readings import as_fit_run, reading_of_run
from pendmap.identification.sensitivity import upper_limit
from pendmap.identification.turning import TooShortError, rotating_start, rough_start, swinging
from pendmap.model import Rig
from pendmap.model.effects import Effect
from pendmap.signal.half_cycles import swings
from pendmap.signal.robust import span
from pendmap.tables.findings import finding_of, texts

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.readings import Reading
    from pendmap.identification.runs import FitRun
    from pendmap.records import Run

DRAG: Final = "quadratic_drag"  # Effect tried where viscous damping and friction do not fit
UNFIT: Final = "the model does not fit"  # First words of the warning of it
NEAR_UPRIGHT: Final = 0.3  # Angle from upright, rad, within which no fit may follow a run
MOST_LEFT: Final = 0.5  # Least share of a run that is fitted from where it leaves upright
LACKING: Final = 4.0  # Widening above which weights are equal: else the slowest would dominate


def identification_of(joint: JointFit) -> Identification:
    """Return the identification from a fit."""
    fit, runs = joint.fit, joint.runs
    part = span(runs[0].time) if len(runs) == 1 else counted(len(runs), "free run")
    names = tuple("offset" if name == f"{OFFSET}.d" else name for name in fit.names)
    # If the model does not fit, errors are widened by the misfit.
    wider = math.sqrt(fit.widening)
    known = {
        name: dataclasses.replace(e, stderr=None if e.stderr is None else wider * e.stderr)
        for name, e in zip(names, fit.estimates.values(), strict=True)
    }
    known |= {name: Estimate(0.0, None, (0.0, limit)) for name, limit in joint.limits.items()}
    order = dict.fromkeys(["w0", *OPPOSING, *known])
    estimates = {name: known[name] for name in order if name in known}
    count = len(fit.windows)
    motions = "one motion" if len(runs) == 1 else f"{len(runs)} motions"
    how = f"as {motions}" if count == len(runs) else f"in {count} windows"
    total = sum(len(reading.each) for reading in joint.readings)
    units = {r.unit for r in joint.readings}
    sigmas = [r.sigma * (r.gain if len(units) == 1 else 1.0) for r in joint.readings]
    noise = " to ".join(f"{x:.2e}" for x in sorted({min(sigmas), max(sigmas)}))
    noise += f" {units.pop() if len(units) == 1 else 'rad'}"
    return Identification(
        estimates=estimates,
        used=f"{fit.samples} readings of {total}, {part}, {how}; noise {noise}",
        warnings=tuple(_warnings(joint, estimates)),
        covariance=(names, fit.widening * fit.covariance),
        misfit=fit.chi2 / max(fit.degrees, 1),
        model=fit.model,
        converged=fit.converged,
        sensors=tuple(reading.unit for reading in joint.readings),
    )


def _warnings(joint: JointFit, estimates: Mapping[str, Estimate]) -> list[str]:
    fit, readings, warnings = joint.fit, joint.readings, []
    if joint.added:
        warnings.append(
            f"viscous damping and Coulomb friction alone did not converge: {joint.added} is fitted "
            "too"
        )
    for name, e in {**estimates, **joint.negative}.items():
        if name in opposing(fit.model.effects) and e.value < 0:
            _, high = e.ci95 or (-math.inf, math.inf)
            why = "an effect is missing in the model" if high < 0 else "its interval reaches 0"
            if name in joint.negative:
                why += "; it is held at 0, and the others are fitted again"
            elif name in OPPOSING:
                why += "; the model has 0 in its place"
            warnings.append(f"{name} is {e.value:.3g}, which is unphysical: {why}")
    if fit.widening > 1:
        warnings.append(
            f"{UNFIT}: residuals are {fit.rms / joint.noise:.3g} times the noise; errors are "
            f"{math.sqrt(fit.widening):.2g} times as wide; an effect is missing in the model"
        )
    if not fit.converged:
        warnings.append("the search did not converge")
    # The interval of a sensor's bias is not reported.
    wanted = {name: e for name, e in estimates.items() if name.partition("[")[0] != SENSOR}
    lost = [name for name, e in wanted.items() if e.ci95 is None and name not in joint.negative]
    if lost:
        warnings.append(f"no finite interval was found for {', '.join(lost)}")
    laws = [reading.law for reading in readings if reading.law]
    warnings += [
        f"{law}: readings are weighted by the noise at their {law.grows_with}" for law in laws
    ]
    coarse = [f"{r.gain * r.count:.3g} {r.unit}" for r in readings if r.coarse]
    if coarse:
        warnings.append(
            f"the sensor's count ({', '.join(dict.fromkeys(coarse))}) is coarser than its noise: "
            "readings are fitted as intervals"
        )
    return warnings


def fit_from_start(
    runs: Sequence[FitRun],
    readings: Sequence[Reading],
    *,
    start: Rig | Mapping[str, float] | None = None,
    held: Collection[str] = (),
    effects: Sequence[Effect | str] = (),
) -> tuple[TrajectoryFit, tuple[Reading, ...]]:
    """Return the joint fit to several records, and their readings.

    ``start`` has starting values; others are from zero crossings and the energy of each half swing
    of the first record, and TooShortError is raised if that has too few. Readings whose noise grows
    with speed are weighted accordingly, unless the model lacks an effect: then weights are equal.
    Coefficients that are ``held`` are 0; further ``effects`` (SI) begin small if given by name; all
    their parameters except exponents, orders and widths are fitted.
    """
    zeros: dict[str, Any] = {name: 0.0 for name in held if "." not in name}
    model = dataclasses.replace(_start_of(start, runs[0], readings[0].sigma), **zeros)
    named = [Effect.blank(e, model.units) if isinstance(e, str) else e for e in effects]
    known = [*model.effects, *named]
    # A sensor on the rod has a bias instead of a zero error.
    zeroed = any(run.rod_sensor is None for run in runs)
    if zeroed and OFFSET not in {e.name for e in known}:
        known.append(Effect(OFFSET, {"d": 0.0}))
    # Nothing determines the other parameters of an effect that is held at 0.
    still = {name.partition(".")[0] for name in held}
    sizes = [f"{e.name}.{size}" for e in known if e.name not in still for size in e.sizes]
    model = dataclasses.replace(model, effects=tuple(e.held(held) for e in known))
    free = ["w0", *(name for name in OPPOSING if name not in held), *sizes]
    doubt = max(reading.doubt for reading in readings)
    fit = fit_runs(runs, model, free, sigma_doubt=doubt)
    if fit.widening > LACKING and any(reading.law for reading in readings):
        readings = [
            dataclasses.replace(r, each=np.full_like(r.each, r.sigma), law=None) for r in readings
        ]
        pairs = zip(runs, readings, strict=True)
        runs = [dataclasses.replace(run, sigma=reading.each) for run, reading in pairs]
        fit = fit_runs(runs, model, free, sigma_doubt=doubt)
    return fit, tuple(readings)


def _start_of(start: Rig | Mapping[str, float] | None, run: FitRun, sigma: float) -> Rig:
    """Return the starting model: given values, and others from the record's half swings."""
    if isinstance(start, Rig):
        return start
    time, theta = run.time[run.counted], run.angle[run.counted]
    peaks = np.abs(swings(*swinging(time, theta)).peak)
    if peaks.size and np.median(peaks) > math.pi and rotating_start(time, theta) is None:
        text, _ = texts()["angle-unit.wrong"]
        raise InputError(f"{run.name}: {text.format(largest=peaks.max())}")
    rough = rough_start(time, theta, sigma) or {}
    known: dict[str, Any] = {**rough, **(start or {})}
    if "w0" not in known:
        raise TooShortError(
            "the record must show two half swings or more of a free decay, or a natural frequency "
            "must be given: w0 = 6.2 under [rig] in experiment.toml"
        )
    return Rig(**known)


@dataclasses.dataclass(frozen=True)
class JointFit:
    """Fit of a pendulum to several runs, in the order of its curves and residuals.

    ``negative`` are coefficients that oppose the motion and that a fit made negative, as it gave
    them: they are held at 0 in ``fit``, and ``limits`` are their upper 95 % limits. ``added`` is
    the effect without which the search does not converge.
    """

    fit: TrajectoryFit
    runs: tuple[Run, ...]
    readings: tuple[Reading, ...]
    negative: Mapping[str, Estimate] = dataclasses.field(default_factory=dict)
    limits: Mapping[str, float] = dataclasses.field(default_factory=dict)
    added: str = ""

    @property
    def given(self) -> list[FitRun]:
        """The runs as they are fitted."""
        return [as_fit_run(*pair) for pair in zip(self.runs, self.readings, strict=True)]

    @property
    def noise(self) -> float:
        """Root mean square noise of the included readings, rad."""
        counts = [int(run.trusted.sum()) for run in self.runs]
        square = np.average([reading.sigma**2 for reading in self.readings], weights=counts)
        return math.sqrt(square)


def fit_together(
    runs: Sequence[Run],
    *,
    start: Rig | Mapping[str, float] | None = None,
    effects: Sequence[Effect | str] = (),
) -> JointFit:
    """Fit natural frequency, damping, the sensor's zero error and effects to one or more runs.

    The choices are those of :func:`fit_from_start`. If the search does not converge, quadratic drag
    is fitted too (given no effects and no model); then runs are cut to where they leave upright.
    """
    later = [_from_upright(run) for run in runs]
    fixed = effects or isinstance(start, Rig)
    first = None
    for used, added in itertools.product((runs, later), ("",) if fixed else ("", DRAG)):
        if used is later and all(run is cut for run, cut in zip(runs, later, strict=True)):
            break
        with contextlib.suppress(FitDiverged):
            free = fit_trusted(used, start, [added] if added else effects)
            joint = physical(free) if free.fit.converged else free
            if joint.fit.converged and (not added or min(joint.fit.model.effects[0].values) > 0):
                return dataclasses.replace(joint, added=added)
            first = first or joint
    return physical(first or fit_trusted(runs, start, effects))


def _from_upright(run: Run) -> Run:
    """Return a run that is used from where it has last left the upright position."""
    near = np.cos(run.theta) < -math.cos(NEAR_UPRIGHT)
    after = np.arange(run.time.size) > np.max(np.flatnonzero(near), initial=-1)
    left = np.count_nonzero(run.trusted & after)
    if (
        run.gyroscope is not None
        or not np.count_nonzero(run.trusted) > left > MOST_LEFT * after.size
    ):
        return run
    begin = moment(run.time[int(np.argmax(after))])
    finding = finding_of("upright-left-out", where=run.name, begin=begin)
    return dataclasses.replace(run, trusted=run.trusted & after, findings=(*run.findings, finding))


def fit_trusted(
    runs: Sequence[Run], start: Rig | Mapping[str, float] | None, effects: Sequence[Effect | str]
) -> JointFit:
    """Return the fit to all trusted readings of runs."""
    readings = [reading_of_run(run) for run in runs]
    given = [as_fit_run(run, reading) for run, reading in zip(runs, readings, strict=True)]
    fit, worth = fit_from_start(given, readings, start=start, effects=effects)
    return JointFit(fit, tuple(runs), worth)


def physical(joint: JointFit) -> JointFit:
    """Return a fit whose damping and sizes of effects do not drive the motion.

    What opposes the motion and is estimated below 0 is held at 0, and the others are fitted again.
    Where no such fit is found, the fit is returned as it is.
    """
    while name := joint.fit.negative:
        known = {**joint.negative, name: joint.fit.estimates[name]}
        given = joint.given
        try:
            fit, worth = fit_from_start(given, joint.readings, start=joint.fit.model, held=known)
            # An estimate below 0 is wrong by no less than its size.
            limits = {n: max(upper_limit(fit, given, n), -e.value) for n, e in known.items()}
        except FitDiverged:
            return joint
        joint = JointFit(fit, joint.runs, worth, known, limits, joint.added)
    return joint
