"""Sensitivities of readings to parameters, orthogonal to those to the initial states."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import FitDiverged, core_errors
from pendmap.identification.fit import prepared
from pendmap.identification.parameters import SENSOR
from pendmap.identification.runs import bare_windows, tolerance_of

if TYPE_CHECKING:
    from collections.abc import Sequence

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
    base = [name for name in base if name not in SENSOR]  # always fitted
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
