"""Sensitivities of readings to parameters, orthogonal to those to the initial states.

The sum of squares has a narrow, curved valley in an effect's size and exponent.
:func:`refine_exponent` follows it by variable projection (Golub & Pereyra 1973, SIAM J. Numer.
Anal. 10, 413): the step of the exponent is computed from its derivatives, orthogonal to those of
the other parameters.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import FitDiverged, core_errors
from pendmap.identification.fit import LEVEL, prepared
from pendmap.identification.parameters import SENSOR
from pendmap.identification.runs import bare_windows, tolerance_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig
    from pendmap.signal import Floats

STATE: Final = 2  # Number of columns of an initial state
FOLLOWED: Final = 1e-6
"""Norm after the projection, relative to before, below which a column is rounding, set to 0."""

BLIND: Final = 1e-11
"""Relative norm below which a direction of the initial state does not affect the readings."""


@dataclasses.dataclass(frozen=True)
class Sensitivities:
    """Derivatives over standard errors of included samples, orthogonal to initial states."""

    names: tuple[str, ...]  # parameters, as in a fit
    columns: Floats  # shape (n, k), by the parameters in SI
    residual: Floats  # shape (n,), reading less model
    run: NDArray[np.int64]  # shape (n,)


@dataclasses.dataclass(frozen=True)
class WindowSlopes:
    """Derivatives in one window over the standard errors; rows of excluded samples are zero."""

    run: int
    first: int  # first sample
    columns: Floats  # shape (n, k), by the parameters in SI
    states: Floats  # shape (n, 2), by angle and velocity (rad w0)
    residual: Floats  # shape (n,), reading less model, or its substitute for intervals
    weight: Floats  # shape (n,), one over the standard error, or its substitute

    def columns_as_in(self, other: WindowSlopes) -> Floats:
        """Return the columns with the weights of ``other``, the same window of another fit.

        The weights of interval readings depend on the motion; between two fits they differ
        slightly, but by more than the columns.
        """
        ratio = np.divide(
            other.weight, self.weight, out=np.zeros_like(self.weight), where=self.weight > 0
        )
        return np.asarray(self.columns * ratio[:, None], np.float64)

    def freed(self, further: Floats) -> tuple[Floats, Floats, Floats]:
        """Return columns, further ones and residual orthogonal to the state, without zero rows."""
        counted = self.states.any(axis=1) | self.columns.any(axis=1)
        basis = _basis(self.states[counted])

        def free(values: Floats) -> Floats:
            rows = values[counted]
            rest = rows - basis @ (basis.T @ rows)
            followed = lengths(rest) < FOLLOWED * lengths(rows)
            return np.asarray(np.where(followed, 0.0, rest), np.float64)

        return free(self.columns), free(further), free(self.residual)


def window_slopes(
    fit: TrajectoryFit, runs: Sequence[FitRun], candidates: Sequence[str], model: Rig
) -> tuple[tuple[str, ...], list[WindowSlopes]]:
    """Return the parameters' names and the derivatives in each window."""
    from pendmap import _core  # noqa: PLC0415 (deferred import of the core)

    base = list(dict.fromkeys(name.partition("[")[0] for name in fit.names))
    base = [name for name in base if name != SENSOR]  # always fitted
    start = {name: fit.estimates[name].value for name in fit.names}
    unknown, given = prepared(runs, model, [*base, *candidates], start)
    begin, windows = unknown.start, bare_windows(fit.windows, unknown.units)
    with core_errors(FitDiverged):
        slopes = _core.fit_rows(given, begin, tolerance_of(runs), windows)
    ends = np.cumsum([len(one.rows) for one in slopes])
    bare = np.zeros((int(ends[-1]), len(begin)))
    for one, end in zip(slopes, ends, strict=True):
        bare[end - len(one.rows) : end, one.free] = one.rows[:, :-STATE]
    columns = np.split(unknown.columns(bare, [value for _, value in begin]), ends[:-1])
    return unknown.names, [
        WindowSlopes(*window[:2], block, one.rows[:, -STATE:], one.residuals, one.weights)
        for one, window, block in zip(slopes, fit.windows, columns, strict=True)
    ]


def sensitivities(
    fit: TrajectoryFit, runs: Sequence[FitRun], candidates: Sequence[str], model: Rig
) -> Sensitivities:
    """Return the derivatives by a fit's parameters and by further ones, ``candidates``.

    ``model`` is the fit's model with the candidates' effects added.
    """
    return freed_together(*window_slopes(fit, runs, candidates, model))


def freed_together(names: tuple[str, ...], windows: Sequence[WindowSlopes]) -> Sensitivities:
    """Return the derivatives of all windows, orthogonal to the initial states."""
    parts = [window.freed(window.columns[:, :0]) for window in windows]
    columns, _, residual = (np.concatenate(part) for part in zip(*parts, strict=True))
    run = np.repeat(
        [window.run for window in windows], [len(residuals) for _, _, residuals in parts]
    )
    return Sensitivities(names, columns, residual, run)


def lengths(columns: Floats) -> Floats:
    """Return the norm of each column, in one pass through the rows in memory order."""
    return np.asarray(np.sqrt(np.einsum("n...,n...->...", columns, columns)), np.float64)


def _basis(states: Floats) -> Floats:
    """Return an orthonormal basis of the derivatives by the initial state."""
    sizes = np.linalg.norm(states, axis=0)
    seen = states[:, sizes > BLIND * max(float(sizes.max(initial=0.0)), 1e-300)]
    if not seen.size:
        return np.zeros((len(states), 0))
    q, r = np.linalg.qr(seen / np.linalg.norm(seen, axis=0))
    return np.asarray(q[:, np.abs(np.diag(r)) > BLIND], np.float64)


STAGES: Final = 8  # Most exponents tried
REACH: Final = 0.2  # Initial longest step of an exponent, less than the spacing of the scan
FARTHEST: Final = 3.0  # Largest change of the logarithm of a size in one step
SHORTER: Final = 0.25  # New longest step, over a step that made the fit worse
SHORTEST: Final = 0.01  # Longest step below which the search ends
PROMISED: Final = 0.01  # Expected gain in the sum of squares below which the search ends


def refine_exponent(
    fit: TrajectoryFit,
    runs: Sequence[FitRun],
    size: str,
    exponent: str,
    again: Callable[[Rig, Mapping[str, float], TrajectoryFit], TrajectoryFit],
) -> TrajectoryFit:
    """Return a fit with an exponent, fixed in each fit, near its best value.

    ``again`` fits a model from given starting values, with the windows of a fit.
    """
    reach = REACH
    for _ in range(STAGES):
        step, gain, follow = _step(fit, runs, exponent)
        if gain < PROMISED or reach < SHORTEST or fit[size] == 0:
            break
        step = math.copysign(min(abs(step), reach), step)
        start = {name: e.value - step * follow[name] for name, e in fit.estimates.items()}
        # A size depends exponentially on its exponent, so its logarithm is extrapolated.
        power = max(-FARTHEST, min(-step * follow[size] / fit[size], FARTHEST))
        start[size] = fit[size] * math.exp(power)
        try:
            trial = again(_with(fit.model, exponent, step), start, fit)
        except FitDiverged:
            reach = SHORTER * abs(step)
            continue
        if trial.chi2 < fit.chi2:
            fit = trial
        else:
            reach = SHORTER * abs(step)
    return fit


def _step(
    fit: TrajectoryFit, runs: Sequence[FitRun], exponent: str
) -> tuple[float, float, dict[str, float]]:
    """Return an exponent's step, its expected gain, and derivatives of the other parameters."""
    seen = sensitivities(fit, runs, [exponent], fit.model)
    place = seen.names.index(exponent)
    column, others = seen.columns[:, place], np.delete(seen.columns, place, axis=1)
    sizes = np.linalg.norm(others, axis=0)
    sizes[sizes == 0] = 1.0
    follow = np.linalg.lstsq(others / sizes, column)[0] / sizes
    rest = column - others @ follow
    information, pull = float(rest @ rest), float(rest @ seen.residual)
    names = [name for name in seen.names if name != exponent]
    if information <= 0:
        return 0.0, 0.0, {}
    return pull / information, pull**2 / information, dict(zip(names, follow, strict=True))


def upper_limit(fit: TrajectoryFit, runs: Sequence[FitRun], name: str) -> float:
    """Return the upper end of the 95 % interval that a parameter held at 0 has about 0."""
    step, gain, _ = _step(fit, runs, name)
    return abs(step) * math.sqrt(LEVEL * fit.widening / gain) if gain else math.inf


def _with(model: Rig, exponent: str, step: float) -> Rig:
    """Return a model whose exponent is changed by a step, within its range."""
    name, _, parameter = exponent.rpartition(".")
    effect = next(e for e in model.effects if e.name == name)
    low, high = effect.definition[parameter].range
    value = min(max(effect.parameters[parameter] + step, low), high)
    other = dataclasses.replace(effect, parameters={**effect.parameters, parameter: value})
    effects = tuple(other if e is effect else e for e in model.effects)
    return dataclasses.replace(model, effects=effects)
