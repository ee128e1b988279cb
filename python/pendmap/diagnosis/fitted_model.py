"""Models fitted to records within physical limits, and weights that include a model's error."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Any, Final, ParamSpec, TypeVar

import numpy as np

from pendmap.diagnosis.candidates import add_candidates
from pendmap.errors import FitDiverged
from pendmap.identification.fit import TrajectoryFit, fit_runs
from pendmap.identification.sensitivity import refine_exponent
from pendmap.residuals.noise import ResidualNoise, estimate_noise

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pendmap.comparison.data import DataSplit
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig
    from pendmap.model.effects import EffectParameter

Windows = tuple[tuple[int, int, int, float, float], ...]

Given = ParamSpec("Given")
Found = TypeVar("Found")

LITTLE: Final = 0.05
"""Promised fall of the sum of squares, over one independent reading's, below which a fit ends."""
EXACT: Final = 1e-3  # The same of a converged fit
LEAST_LEVEL: Final = 0.5  # Least variance of noise over the stated variance of its readings
FEW_STEPS: Final = 12  # Most steps of a candidate's fit; the right candidate needs about five
SIZED_STEPS: Final = 5  # Most steps of the fit of a size before its shape is fitted
NEAR_STEPS: Final = 6  # Most steps of a fit after an exponent was moved
STRETCH: Final = 2.0  # Factor by which a width may leave its typical range


@dataclasses.dataclass(frozen=True, eq=False)
class FittedModel:
    """A model fitted to records; compared by identity."""

    fit: TrajectoryFit  # To the records that are not held back
    free: tuple[str, ...]  # Names of the fitted parameters, as in fit_runs
    chosen: tuple[Candidate, ...]  # Effects added to the baseline
    runs: tuple[FitRun, ...]  # Fitted records
    floors: tuple[float, ...]  # Share of rounding in the variance of each run's noise
    # Coefficients with negative estimates, fixed at 0; a larger model frees them again.
    zeroed: tuple[str, ...] = ()

    @functools.cached_property
    def noise(self) -> ResidualNoise:
        """Noise of the residuals, and their excess over it."""
        return estimate_noise(self.fit, self.runs, len(self.fit.names), self.floors)

    @property
    def widening(self) -> float:
        """Factor of the fit's variances for correlated or strong noise and errors of the model."""
        return max(self.noise.level, self.chi2 / max(self.fit.degrees, 1), 1.0)

    @functools.cached_property
    def level(self) -> float:
        """Sum of squares of one independent reading.

        It is the greater of the noise's spectral density at the frequencies of the motion, and of
        the sum of squares over the number of independent readings among the residuals.
        """
        noise = self.noise
        return max(noise.level, self.chi2 / max(noise.independent, 1.0), LEAST_LEVEL)

    @property
    def chi2(self) -> float:
        """Sum of squared residuals over standard errors, or of deviances of counts."""
        return self.fit.chi2

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the added effects."""
        return tuple(candidate.name for candidate in self.chosen)

    @property
    def taken(self) -> set[str]:
        """Names of the model's effects and of its fitted parameters."""
        parameters = {name.partition("[")[0] for name in self.free}
        return {effect.name for effect in self.fit.model.effects} | parameters

    @property
    def start(self) -> dict[str, float]:
        """Fitted values, the start of other fits; damping may be negative here."""
        return {name: estimate.value for name, estimate in self.fit.estimates.items()}

    def start_without(self, names: Sequence[str]) -> dict[str, float]:
        """Return the start of a fit with some parameters at 0, the others moved by covariance."""
        start = self.start
        places = [self.fit.names.index(name) for name in names if name in self.fit.names]
        block = self.fit.covariance[np.ix_(places, places)]
        column = self.fit.covariance[:, places]
        if places and np.isfinite(self.fit.covariance).all() and np.linalg.matrix_rank(block):
            values = np.array([start[self.fit.names[k]] for k in places])
            moved = column @ (np.linalg.pinv(block, hermitian=True) @ values)
            start |= {n: start[n] - m for n, m in zip(self.fit.names, moved, strict=True)}
        return {name: value for name, value in start.items() if name not in names}

    @property
    def adapted(self) -> int:
        """Number of adapted parameters, with scanned shapes and coefficients fixed at 0."""
        free = set(self.free)
        scanned = sum(c.count - len(free & {*c.free, *c.adapted}) for c in self.chosen)
        return len(self.fit.names) + len(self.zeroed) + scanned


def fit_model(
    data: DataSplit,
    model: Rig,
    free: Sequence[str],
    chosen: Sequence[Candidate] = (),
    *,
    zeroed: Sequence[str] = (),
    **search: Any,  # noqa: ANN401 (arguments of fit_runs)
) -> FittedModel:
    """Fit a model to records, without profiles; ``zeroed`` are coefficients fixed at 0."""
    fit = fit_runs(data.fitted, model, free, profiled=(), **search)
    return FittedModel(fit, tuple(free), tuple(chosen), data.fitted, data.floors, tuple(zeroed))


def none_if_diverged(fit: Callable[Given, Found]) -> Callable[Given, Found | None]:
    """Return a function that returns None if a fit diverges."""

    @functools.wraps(fit)
    def attempt(*given: Given.args, **named: Given.kwargs) -> Found | None:
        try:
            return fit(*given, **named)
        except FitDiverged:
            return None

    return attempt


@none_if_diverged
def fit_again(
    data: DataSplit,
    fitted: FittedModel,
    **changed: Any,  # noqa: ANN401 (arguments of fit_model)
) -> FittedModel:
    """Fit a model again, with the given arguments changed, from its parameters and windows."""
    usual: dict[str, Any] = {
        "model": fitted.fit.model,
        "free": fitted.free,
        "chosen": fitted.chosen,
        "start": fitted.start,
        "windows": fitted.fit.windows,
    }
    return fit_model(data, **(usual | changed))


def converge(data: DataSplit, fitted: FittedModel, level: float) -> FittedModel | None:
    """Return a fit continued to convergence; None if it diverges."""
    if fitted.fit.converged:
        return fitted
    return fit_again(data, fitted, zeroed=fitted.zeroed, least_gain=EXACT * level)


def settles(data: DataSplit, fitted: FittedModel) -> bool:
    """Return whether a further search lowers the sum of squares by less than a reading's share.

    In a curved valley steps gain far less than they promise.
    """
    again = converge(data, fitted, fitted.level)
    return again is not None and fitted.chi2 - again.chi2 <= LITTLE * fitted.level


@none_if_diverged
def fit_with_candidates(  # noqa: PLR0913 (what to fit, and from where)
    data: DataSplit,
    fitted: FittedModel,
    added: Sequence[Candidate],
    start: Mapping[str, float],
    *,
    level: float,
    short: bool = False,
) -> FittedModel:
    """Fit a model with further effects, from the parameters and windows of a fitted one.

    Coefficients fixed at 0 are free again. Steps that promise less than a small part of ``level``
    are not taken. ``short`` starts from short windows instead.
    """
    model = add_candidates(fitted.fit.model, added)
    free = [*fitted.free, *fitted.zeroed, *(name for c in added for name in c.free)]
    shapes = [name for c in added for name in c.adapted]
    begin = dict.fromkeys(fitted.zeroed, 0.0) | fitted.start | dict(start)
    windows = None if short else fitted.fit.windows
    least = LITTLE * level
    fit = functools.partial(fit_model, data, least_gain=least)
    if shapes and not short:
        # A shape is determined only once its effect has a size.
        steps = FEW_STEPS if any(c.exponents for c in added) else SIZED_STEPS
        sized = fit(model, free, start=begin, windows=windows, steps=steps)
        sized = _adjust_exponents(data, sized, added, least)
        # The exponent of the model sets the unit of its size.
        model, begin, windows = sized.fit.model, sized.start, sized.fit.windows
    chosen = (*fitted.chosen, *added)
    return fit(model, [*free, *shapes], chosen, start=begin, windows=windows, steps=FEW_STEPS)


def _adjust_exponents(
    data: DataSplit, sized: FittedModel, added: Sequence[Candidate], least: float
) -> FittedModel:
    """Return a fit of candidates' sizes with exponents near their best values."""
    near = functools.partial(fit_model, data, steps=NEAR_STEPS, least_gain=least)

    def again(model: Rig, start: Mapping[str, float], before: TrajectoryFit) -> TrajectoryFit:
        return near(model, sized.free, start=start, windows=before.windows).fit

    fit = sized.fit
    for candidate in added:
        for size, exponent in candidate.exponents.items():
            fit = refine_exponent(fit, data.fitted, size, exponent, again)
    return dataclasses.replace(sized, fit=fit)


def impose_physics(
    data: DataSplit, fitted: FittedModel, target: float = math.inf
) -> FittedModel | None:
    """Return a fit with physically possible coefficients; None if an effect is impossible.

    A coefficient that opposes the motion and is estimated below 0, whatever its error, is held at
    0, and the others are fitted again: damping, friction and given effects are fixed, an added
    effect is no longer in the model. An added effect must not drive the motion by a drift or an
    asymmetry greater than the coefficient, must last longer than a swing and no longer than the
    records, and must have a width near its typical range. A fit far above ``target`` is abandoned.
    """
    while name := fitted.fit.negative:
        start = fitted.start_without([name])
        again = fit_without(data, fitted, name, start, least=LITTLE * fitted.level, target=target)
        if again is None:
            return None
        fitted = again
    return fitted if all(_possible(data, fitted, c) for c in fitted.chosen) else None


def fit_without(  # noqa: PLR0913 (what is left out, and how the rest is fitted)
    data: DataSplit,
    fitted: FittedModel,
    name: str,
    start: Mapping[str, float],
    *,
    least: float,
    target: float = math.inf,
    freed: Sequence[str] = (),
) -> FittedModel | None:
    """Return a fit with a coefficient at 0: of an added effect without the effect, else fixed.

    ``freed`` are coefficients fixed at 0 that are fitted again. None if the fit diverges.
    """
    model = fitted.fit.model
    dropped = {c.name: {*c.free, *c.adapted} for c in fitted.chosen if c.free[0] == name}
    gone = {name}.union(*dropped.values())
    effects = tuple(e.held([name]) for e in model.effects if e.name not in dropped)
    zeros: dict[str, Any] = {} if "." in name else {name: 0.0}
    return fit_again(
        data,
        fitted,
        model=dataclasses.replace(model, effects=effects, **zeros),
        free=[n for n in (*fitted.free, *freed) if n not in gone],
        chosen=tuple(c for c in fitted.chosen if c.name not in dropped),
        zeroed=[n for n in fitted.zeroed if n not in freed] + [name] * (not dropped),
        start={n: value for n, value in start.items() if n not in gone},
        least_gain=least,
        target=target,
    )


def _possible(data: DataSplit, fitted: FittedModel, candidate: Candidate) -> bool:
    """Return whether the size and shape of an effect are physically possible."""
    estimates = fitted.fit.estimates
    size = estimates.get(candidate.free[0])
    if size is None:
        return True
    end = max(run.lab_time_s + float(run.time[-1]) for run in data.fitted)
    span = end - min(run.lab_time_s + float(run.time[0]) for run in data.fitted)
    entries = {entry.name: entry for entry in candidate.definition.parameters}
    w0 = fitted.fit.model.w0
    ranges = {"time constant": (math.tau / w0, span), "instant": (end - span, end)}
    for name in candidate.shape:
        estimate, entry = estimates.get(f"{candidate.name}.{name}"), entries[name]
        low, high = ranges.get(entry.role, (-math.inf, math.inf))
        if entry.role == "width":
            unit = w0**entry.power_of_w0
            low, high = entry.typical[0] / STRETCH * unit, entry.typical[1] * STRETCH * unit
        if estimate is not None and not low <= estimate.value <= high:
            return False
    return _drains(fitted, candidate, entries[candidate.size], end)


def _drains(fitted: FittedModel, candidate: Candidate, entry: EffectParameter, end: float) -> bool:
    """Return whether damping or friction stays positive with a drift or an asymmetry of it."""
    if candidate.definition.group != "damping" or entry.typical[0] >= 0:
        return True
    drifts = candidate.definition.mappable == "frozen"
    # The unit of a rate has one more power of w0 than that of the drifting coefficient.
    power = entry.power_of_w0 - drifts
    base = "Tr" if power == 2 else "c_over_m"  # noqa: PLR2004 (a torque)
    size, limit = fitted.fit[candidate.free[0]], fitted.start.get(base, 0.0)
    return size * end + limit >= 0 if drifts else abs(size) <= limit


def model_errors(data: DataSplit, fitted: FittedModel) -> tuple[float, ...]:
    """Return the root mean square residual in each fitted run, rad; 0 if noise explains it."""
    rows = residual_ratios(data, fitted)
    return tuple(rms if ratio > allowed else 0.0 for rms, ratio, allowed in rows)


def residual_ratios(data: DataSplit, fitted: FittedModel) -> list[tuple[float, float, float]]:
    """Return the rms residual (rad) of each fitted run, and the mean of squares over the noise's.

    The third number is the greatest mean that noise explains: ``1 + 4 sqrt(2 / N + 4 r^2)``, with
    the relative error ``r`` of the noise.
    """
    rows = []
    for run, residual, of in zip(data.fitted, fitted.fit.residuals, data.fitted_of, strict=True):
        good = np.isfinite(residual) & run.counted
        rounding = (run.count or 0.0) / math.sqrt(12)
        squares, noise = residual[good] ** 2, run.sigmas[good] ** 2 + rounding**2
        rms, ratio = (float(np.mean(x)) if x.size else 0.0 for x in (squares, squares / noise))
        doubt = data.readings[of].doubt
        allowed = 1 + 4 * math.sqrt(2 / max(squares.size, 1) + 4 * doubt**2)
        rows.append((math.sqrt(rms), ratio, allowed))
    return rows


def weight_records(data: DataSplit, errors: Sequence[float]) -> DataSplit:
    """Return records whose standard errors are a model's errors, if these are not 0.

    With the weights of noise alone, an erring model would follow the readings with the least noise
    and miss the others. Stretches held back have the error of their run; a whole run held back has
    its own noise and the mean excess of the other runs' squared errors over their noise.
    """
    of = dict(zip(data.fitted_of, errors, strict=True))
    pairs = list(zip(data.fitted, errors, strict=True))
    excess = float(np.mean([max(error**2 - _variance(run), 0.0) for run, error in pairs]))
    held = (
        _with_error(run, of.get(k, math.sqrt(_variance(run) + excess) if excess > 0 else 0.0))
        for run, k in zip(data.held, data.held_of, strict=True)
    )
    fitted = (_with_error(run, error) for run, error in pairs)
    return dataclasses.replace(data, fitted=tuple(fitted), held=tuple(held))


def _variance(run: FitRun) -> float:
    """Return the mean square of the standard errors of a run, with rounding to counts."""
    return float(np.mean(np.square(run.sigma))) + (run.count or 0.0) ** 2 / 12


def _with_error(run: FitRun, error: float) -> FitRun:
    if error == 0:
        return run
    return dataclasses.replace(run, sigma=np.full(run.time.shape, error), count=None)
