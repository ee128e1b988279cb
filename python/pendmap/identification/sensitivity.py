"""What each reading says about parameters: derivatives sample by sample, initial states aside."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import FitDiverged, core_errors
from pendmap.identification.fit import prepared
from pendmap.identification.runs import bare_windows, tolerance_of
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig

STATE: Final = 2
"""Columns of an initial state."""

FOLLOWED: Final = 1e-6
"""What the initial state follows to within this part of it, it follows: the rest is rounding."""

BLIND: Final = 1e-11
"""A direction of the state that changes readings by less than this part of the other is unseen."""


@dataclasses.dataclass(frozen=True)
class Sensitivities:
    """Derivatives of the model's readings over their standard errors.

    Parameters
    ----------
    names : tuple of str
        The parameters, as in a fit.
    columns : ndarray of float, shape (n, k)
        One row a sample that counts, by the parameters in SI, what each window's initial state can
        follow taken off.
    residual : ndarray of float, shape (n,)
        Reading less model over the standard error, the same taken off.
    run, sample, window : ndarray of int, shape (n,)
        Which run, sample and window each row is of.
    """

    names: tuple[str, ...]
    columns: NDArray[np.float64]
    residual: NDArray[np.float64]
    run: NDArray[np.int64]
    sample: NDArray[np.int64]
    window: NDArray[np.int64]


@dataclasses.dataclass(frozen=True)
class WindowSlopes:
    """Derivatives in one window, over the standard errors; rows of zeros do not count.

    Parameters
    ----------
    run, first : int
        Which run, and its first sample.
    columns : ndarray of float, shape (n, k)
        By the parameters, in SI.
    states : ndarray of float, shape (n, 2)
        By the initial angle, and by the initial velocity in rad per ``1 / w0``.
    residual : ndarray of float, shape (n,)
        Reading less model; of readings that are intervals the residual that stands for it.
    weight : ndarray of float, shape (n,)
        One over the standard errors, or what stands for it.
    """

    run: int
    first: int
    columns: NDArray[np.float64]
    states: NDArray[np.float64]
    residual: NDArray[np.float64]
    weight: NDArray[np.float64]

    def columns_as_in(self, other: WindowSlopes) -> NDArray[np.float64]:
        """Return the columns with the weights of the same window of another pass.

        The weight of a reading that is an interval goes by the motion, and that of two passes
        differs by what keeps a phase in them: little, but more than tells columns apart.
        """
        ratio = np.divide(
            other.weight, self.weight, out=np.zeros_like(self.weight), where=self.weight > 0
        )
        return np.asarray(self.columns * ratio[:, None], np.float64)

    def freed(
        self, further: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
        """Return parameters' columns, further ones, residual and place of the samples that count.

        What the initial state can follow is taken off.
        """
        counted = self.states.any(axis=1) | self.columns.any(axis=1)
        basis = _basis(self.states[counted])

        def free(values: NDArray[np.float64]) -> NDArray[np.float64]:
            kept = values[counted]
            rest = kept - basis @ (basis.T @ kept)
            followed = lengths(rest) < FOLLOWED * lengths(kept)
            return np.asarray(np.where(followed, 0.0, rest), np.float64)

        places = np.flatnonzero(counted).astype(np.int64)
        return free(self.columns), free(further), free(self.residual), places


def window_slopes(
    fit: TrajectoryFit, runs: Sequence[FitRun], candidates: Sequence[str], model: Rig
) -> tuple[tuple[str, ...], list[WindowSlopes]]:
    """Return the parameters' names and the derivatives window by window.

    Parameters and errors are those of :func:`sensitivities`.
    """
    from pendmap import _core  # noqa: PLC0415 (the core is loaded where it works)

    units = Units(model.w0, si=True)
    base = list(dict.fromkeys(name.partition("[")[0] for name in fit.names))
    start = {name: fit.estimates[name].value for name in fit.names}
    unknown, given = prepared(runs, model, [*base, *candidates], start, units)
    begin = unknown.start
    with core_errors(FitDiverged):
        found = _core.fit_rows(given, begin, tolerance_of(runs), bare_windows(fit.windows, units))
    ends = np.cumsum([len(rows) for _, rows, _, _ in found])
    bare = np.zeros((int(ends[-1]), len(begin)))
    for (places, rows, _, _), end in zip(found, ends, strict=True):
        bare[end - len(rows) : end, places] = rows[:, :-STATE]
    columns = np.split(unknown.columns(bare, [value for _, value in begin]), ends[:-1])
    return unknown.names, [
        WindowSlopes(*window[:2], own, rows[:, -STATE:], residual, weight)
        for (_, rows, residual, weight), window, own in zip(
            found, fit.windows, columns, strict=True
        )
    ]


def sensitivities(
    fit: TrajectoryFit, runs: Sequence[FitRun], candidates: Sequence[str], model: Rig
) -> Sensitivities:
    """Return the derivatives by a fit's parameters and by further ones.

    Parameters
    ----------
    fit : TrajectoryFit
        Where they are taken.
    runs : sequence of FitRun
        Its records.
    candidates : sequence of str
        Further parameters, as of :func:`pendmap.identification.fit.score`.
    model : Rig
        The fit's model with the candidates' effects in it.

    Raises
    ------
    InputError
        If a name is not known, or the motion is lost.
    """
    return freed_together(*window_slopes(fit, runs, candidates, model))


def freed_together(names: tuple[str, ...], windows: Sequence[WindowSlopes]) -> Sensitivities:
    """Return the derivatives of all windows, what each initial state can follow taken off."""
    columns, residuals, labels = [], [], []
    for index, window in enumerate(windows):
        own, _, residual, counted = window.freed(np.zeros((len(window.residual), 0)))
        columns.append(own)
        residuals.append(residual)
        run = np.full(counted.size, window.run, np.int64)
        labels.append(np.stack([run, window.first + counted, np.full(counted.size, index)]))
    run, sample, of = np.concatenate(labels, axis=1)
    return Sensitivities(names, np.concatenate(columns), np.concatenate(residuals), run, sample, of)


def lengths(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the length of each column, in one pass through the rows as they are stored."""
    return np.asarray(np.sqrt(np.einsum("n...,n...->...", columns, columns)), np.float64)


def _basis(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an orthonormal basis of what the initial state can do."""
    sizes = np.linalg.norm(states, axis=0)
    seen = states[:, sizes > BLIND * max(float(sizes.max(initial=0.0)), 1e-300)]
    if not seen.size:
        return np.zeros((len(states), 0))
    q, r = np.linalg.qr(seen / np.linalg.norm(seen, axis=0))
    return np.asarray(q[:, np.abs(np.diag(r)) > BLIND], np.float64)
