"""What records say, and what further ones would say, about parameters and candidates.

The derivatives ``X`` of readings over their standard errors, without what initial states and phases
that nobody knows can follow, make the information ``F = X' X``. That of independent runs adds up,
so that a proposal's is computed once and added to the records'. What of some columns the others
cannot follow is the Schur complement

``F_aa - F_ab F_bb^-1 F_ba``.
"""

from __future__ import annotations

import dataclasses
import itertools
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.diagnosis.candidates import placed
from pendmap.diagnosis.data import held_parts
from pendmap.identification.free import PER_RUN
from pendmap.identification.sensitivity import window_slopes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.diagnosis.candidates import Candidate
    from pendmap.identification.fitting import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.identification.sensitivity import WindowSlopes

    Floats = NDArray[np.float64]

__all__ = ["Columns", "Information"]

FOLLOWED: Final = 1e-9
"""Directions of the others whose information is less than this part of the greatest are none."""

ALL: Final = 2e-6
"""Where less than this part of a column's information is its own, the others follow all of it."""


@dataclasses.dataclass(frozen=True)
class Information:
    """The information of records about columns.

    Parameters
    ----------
    matrix : ndarray of float, shape (k, k)
        ``X' X``, in SI.
    """

    matrix: Floats

    def __add__(self, other: Information) -> Information:
        return Information(self.matrix + other.matrix)

    def own(self, columns: Sequence[int], others: Sequence[int]) -> Floats:
        """Return what of some columns others cannot follow, shape (n, n)."""
        f = self.matrix
        kept, through = f[np.ix_(columns, columns)], f[np.ix_(columns, others)]
        rest = kept - through @ self._inverse(others) @ through.T
        # Below this it is rounding and the integrator's error.
        shown = np.diag(rest) > ALL * np.diag(kept)
        return np.where(np.outer(shown, shown), rest, 0.0)

    def followed(self, columns: Sequence[int], by: Sequence[int], beside: Sequence[int]) -> Floats:
        """Return the coefficients by which columns come nearest to others, shape (n of by, n).

        Parameters
        ----------
        columns : sequence of int
            Those that are followed.
        by, beside : sequence of int
            Those that follow; coefficients of the first are returned.
        """
        every = [*by, *beside]
        found = self._inverse(every) @ self.matrix[np.ix_(every, columns)]
        return np.asarray(found[: len(by)], np.float64)

    def covariance(self, columns: Sequence[int]) -> Floats:
        """Return the covariance of columns' coefficients, fitted together."""
        return self._inverse(columns)

    def _inverse(self, columns: Sequence[int]) -> Floats:
        part = self.matrix[np.ix_(columns, columns)]
        size = np.sqrt(np.diag(part))
        unit = np.where(size > 0, size, 1.0)
        bare = np.linalg.pinv(part / np.outer(unit, unit), rcond=FOLLOWED, hermitian=True)
        return np.asarray(bare / np.outer(unit, unit), np.float64)


@dataclasses.dataclass(frozen=True)
class Columns:
    """Derivatives at a fit, window by window.

    Parameters
    ----------
    shared : tuple of str
        The fitted parameters that belong to no run alone; the first columns.
    places : mapping of Candidate's title to list of int
        The columns of each further candidate: size, and phase if it has one.
    windows : tuple of WindowSlopes
        Columns are those of ``shared`` and the candidates', then those of single runs.
    """

    shared: tuple[str, ...]
    places: dict[str, list[int]]
    windows: tuple[WindowSlopes, ...]

    @property
    def count(self) -> int:
        """How many columns belong to all runs."""
        return len(self.shared) + sum(len(own) for own in self.places.values())

    @classmethod
    def of(
        cls, fit: TrajectoryFit, runs: Sequence[FitRun], candidates: Sequence[Candidate]
    ) -> Columns:
        """Return the derivatives by a fit's parameters and by candidates'.

        Parameters
        ----------
        fit : TrajectoryFit
            Where they are taken, with the windows of the runs.
        runs : sequence of FitRun
            The records.
        candidates : sequence of Candidate
            Further effects; an effect may be there in several shapes.
        """
        shared = tuple(dict.fromkeys(name for name in fit.names if not _of_one_run(name)))
        places: dict[str, list[int]] = {}
        first: list[WindowSlopes] = []
        parts: list[list[Floats]] = []
        by_name: dict[str, list[Candidate]] = {}
        for candidate in candidates:
            by_name.setdefault(candidate.name, []).append(candidate)
        # Shapes of one effect are derived one after the other, those of several together.
        for batch in itertools.zip_longest(*by_name.values()) if by_name else [()]:
            present = [candidate for candidate in batch if candidate is not None]
            further = [name for candidate in present for name in candidate.free]
            names, windows = window_slopes(fit, runs, further, placed(fit.model, present))
            wanted = [names.index(name) for name in further]
            if not first:
                kept = [names.index(name) for name in shared]
                alone = [k for k, name in enumerate(names) if _of_one_run(name)]
                first = windows
                parts = [[w.columns[:, kept], w.columns[:, alone]] for w in windows]
            for part, window, one in zip(parts, windows, first, strict=True):
                part.insert(len(part) - 1, window.columns_as_in(one)[:, wanted])
            for candidate in present:
                at = len(shared) + sum(len(own) for own in places.values())
                places[candidate.title] = list(range(at, at + len(candidate.free)))
        joined = tuple(
            dataclasses.replace(window, columns=np.hstack(part))
            for window, part in zip(first, parts, strict=True)
        )
        return cls(shared, places, joined)

    def information(
        self, run: int | None = None, samples: int | None = None, *, hold: bool = False
    ) -> Information:
        """Return the information of all runs, or of the first samples of one.

        Parameters
        ----------
        run : int, optional
            Which run; all by default.
        samples : int, optional
            How many of its samples; all by default.
        hold : bool
            Whether stretches of it will be held back, as of records of which no whole run is.
        """
        total = np.zeros((self.count, self.count))
        rows: dict[int, list[Floats]] = {}
        for window in self.windows:
            if run is not None and window.run != run:
                continue
            part = window if samples is None else _cut(window, samples, hold=hold)
            if part is not None:
                rows.setdefault(window.run, []).append(part.freed(part.columns[:, :0])[0])
        for found in rows.values():
            columns = np.concatenate(found)
            every, alone = columns[:, : self.count], columns[:, self.count :]
            alone = alone[:, alone.any(axis=0)]
            if alone.size:
                q = np.linalg.qr(alone / np.linalg.norm(alone, axis=0))[0]
                every = every - q @ (q.T @ every)
            total += every.T @ every
        return Information(total)


def _of_one_run(name: str) -> bool:
    return "[" in name or name in PER_RUN


def _cut(window: WindowSlopes, samples: int, *, hold: bool) -> WindowSlopes | None:
    """Return the part of a window that lies within the first samples of its run."""
    length = min(samples - window.first, len(window.residual))
    if length < 3:  # noqa: PLR2004 (two are the state)
        return None
    columns, states = window.columns[:length], window.states[:length]
    if hold:
        kept = np.ones(samples)
        for a, b in held_parts(samples):
            kept[a:b] = 0.0
        kept = kept[window.first : window.first + length, None]
        columns, states = columns * kept, states * kept
    return dataclasses.replace(
        window, columns=columns, states=states, residual=window.residual[:length]
    )
