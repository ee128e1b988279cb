"""Fisher information of records, and of proposed ones, about parameters and candidates.

The derivatives ``X`` of readings over their standard errors, orthogonal to initial states and
unknown phases, give the information ``F = X' X``. The information of independent runs adds up, so
that of a proposal is computed once and added to that of the records. The information of some
parameters with all others fitted is the Schur complement

``F_aa - F_ab F_bb^-1 F_ba``.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.comparison.data import held_parts
from pendmap.diagnosis.next_experiment.proposals import list_proposals
from pendmap.diagnosis.scores import candidate_slopes
from pendmap.errors import FitDiverged
from pendmap.formatting import counted
from pendmap.identification.motion import Motion, run_forward
from pendmap.identification.parameters import PER_RUN
from pendmap.identification.runs import FORCED_WINDOW_SWINGS, FitRun

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.comparison.data import DataSplit
    from pendmap.comparison.replay import Reasons
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import Windows
    from pendmap.diagnosis.next_experiment.proposals import Proposal, Start
    from pendmap.diagnosis.state import ScoredModel
    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.sensitivity import WindowSlopes
    from pendmap.signal import Floats

FOLLOWED: Final = 1e-9
"""Eigenvalue of information over the largest below which a direction is undetermined."""

ALL: Final = 2e-6
"""Share of a column's information, with the others fitted, below which it is set to 0."""

PER_SWING: Final = 25.0
"""Most samples per small swing of a simulated proposal; standard errors are scaled to match."""

MOVING: Final = 1e-9
"""Velocity over ``w0`` below which the pendulum is at rest: its readings carry no information."""

FEWEST: Final = 3  # Fewest readings of a run in a fit


@dataclasses.dataclass(frozen=True)
class Information:
    """Fisher information of records about columns of derivatives."""

    matrix: Floats  # ``X' X``, in SI

    def __add__(self, other: Information) -> Information:
        return Information(self.matrix + other.matrix)

    def own(self, columns: Sequence[int], others: Sequence[int]) -> Floats:
        """Return the information of columns with others fitted, shape (n, n)."""
        f = self.matrix
        kept, through = f[np.ix_(columns, columns)], f[np.ix_(columns, others)]
        own = kept - through @ self.covariance(others) @ through.T
        # Smaller values are rounding and the integrator's error.
        shown = np.diag(own) > ALL * np.diag(kept)
        return np.where(np.outer(shown, shown), own, 0.0)

    def followed(self, columns: Sequence[int], by: Sequence[int], beside: Sequence[int]) -> Floats:
        """Return the coefficients of ``by`` in the fit to columns, with others, (n of by, n)."""
        every = [*by, *beside]
        found = self.covariance(every) @ self.matrix[np.ix_(every, columns)]
        return np.asarray(found[: len(by)], np.float64)

    def covariance(self, columns: Sequence[int]) -> Floats:
        """Return the covariance of columns' coefficients, fitted together."""
        part = self.matrix[np.ix_(columns, columns)]
        size = np.sqrt(np.diag(part))
        unit = np.where(size > 0, size, 1.0)
        bare = np.linalg.pinv(part / np.outer(unit, unit), rcond=FOLLOWED, hermitian=True)
        return np.asarray(bare / np.outer(unit, unit), np.float64)


@dataclasses.dataclass(frozen=True)
class Columns:
    """Derivatives of the readings at a fit, window by window."""

    shared: tuple[str, ...]  # Fitted parameters of all runs, the first columns
    places: dict[str, list[int]]  # Columns of each candidate: size, and phase if it has one
    windows: tuple[WindowSlopes, ...]  # With columns shared, of candidates, and of single runs

    @property
    def count(self) -> int:
        """Number of columns shared by all runs."""
        return len(self.shared) + sum(len(own) for own in self.places.values())

    @classmethod
    def of(
        cls, fit: TrajectoryFit, runs: Sequence[FitRun], candidates: Sequence[Candidate]
    ) -> Columns:
        """Return the derivatives by the parameters of a fit and of candidates, in any shapes."""
        shared = tuple(dict.fromkeys(name for name in fit.names if not _of_one_run(name)))
        by_name: dict[str, list[Candidate]] = {}
        for candidate in candidates:
            by_name.setdefault(candidate.name, []).append(candidate)
        batches = itertools.zip_longest(*by_name.values())
        passes = [[candidate for candidate in batch if candidate] for batch in batches] or [[]]
        names, windows = candidate_slopes(fit, runs, passes)
        places: dict[str, list[int]] = {}
        end = len(shared)
        for candidate in itertools.chain(*passes):
            places[candidate.title] = list(range(end, end + len(candidate.free)))
            end += len(candidate.free)
        further = range(len(names), len(names) + end - len(shared))
        alone = [k for k, name in enumerate(names) if _of_one_run(name)]
        order = [*map(names.index, shared), *further, *alone]
        ordered = (dataclasses.replace(w, columns=w.columns[:, order]) for w in windows)
        return cls(shared, places, tuple(ordered))

    def information(
        self, run: int | None = None, samples: int | None = None, *, hold: bool = False
    ) -> Information:
        """Return the information of all runs, or of the first samples of one.

        ``hold``: without the stretches that would be held out.
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
    """Return the part of a window within the first samples of its run."""
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


class Prospects:
    """Information of proposals, by default of all possible ones, simulated with the model found.

    Proposals in which the model diverges are left out, with their number and reason in ``reasons``.
    """

    def __init__(
        self,
        data: DataSplit,
        found: ScoredModel,
        candidates: Sequence[Candidate],
        reasons: Reasons,
        menu: Sequence[Proposal] | None = None,
    ) -> None:
        fit = found.fitted.fit
        if menu is None:
            menu = list_proposals(data, fit.model.w0)
        self.units = fit.model.units
        self.now = Columns.of(fit, data.fitted, candidates)
        self.old = self.now.information()
        self._hold = data.inside
        longest: dict[Start, float] = {}
        for proposal in menu:
            for start in proposal.runs:
                longest[start] = max(longest.get(start, 0.0), proposal.length_s)
        read = float(np.median([np.median(np.diff(run.time)) for run in data.fitted]))
        self._step = max(read, math.tau / fit.model.w0 / PER_SWING)
        # Standard errors are scaled to the smaller number of samples.
        scale = math.sqrt(read / self._step)
        self._starts, runs, windows = _simulated(data, found, longest, self._step, scale, reasons)
        self.menu = [p for p in menu if all(start in self._starts for start in p.starts)]
        if menu and not self.menu:
            raise FitDiverged(f"of {counted(len(menu), 'proposal')} none: {reasons['proposals']}")
        if len(self.menu) < len(menu):
            reasons["proposals"] = (
                f"{len(menu) - len(self.menu)} of {len(menu)} left out: {reasons['proposals']}"
            )
        ahead = dataclasses.replace(
            fit,
            names=self.now.shared,
            estimates={name: fit.estimates[name] for name in self.now.shared},
            windows=windows,
        )
        self._new = Columns.of(ahead, runs, candidates) if runs else None
        self._known: dict[tuple[Start, float], Information] = {}

    def after(self, proposal: Proposal) -> Information:
        """Return the information of the records and a proposal together."""
        total = self.old
        for start in proposal.runs:
            key = start, proposal.length_s
            if key not in self._known and self._new is not None:
                samples = round(proposal.length_s / self._step) + 1
                self._known[key] = self._new.information(
                    self._starts.index(start), samples, hold=self._hold
                )
            total += self._known[key]
        return total


def _simulated(  # noqa: PLR0913, PLR0917 (the model, the runs, how they are read)
    data: DataSplit,
    found: ScoredModel,
    longest: dict[Start, float],
    step: float,
    scale: float,
    reasons: Reasons,
) -> tuple[list[Start], list[FitRun], Windows]:
    """Return starts, runs and windows that the model can simulate, with errors times ``scale``."""
    motion, w0 = Motion.of(found.fitted.fit), found.fitted.fit.model.w0
    readings = [data.readings[k] for k in data.fitted_of]
    floor = float(np.median([reading.sigma for reading in readings]))
    late = float(np.median([0.0 if r.law is None else r.law.tau for r in readings]))
    starts: list[Start] = []
    runs: list[FitRun] = []
    windows: list[tuple[int, int, int, float, float]] = []
    for start, seconds in longest.items():
        samples = round(seconds / step) + 1
        time, lab = step * np.arange(samples, dtype=np.float64), start.lab_time_s
        drive = None if start.drive is None else dict(start.drive)
        run = FitRun(time, np.zeros(samples), floor, drive=drive, lab_time_s=lab)
        try:
            ((_, curve),) = run_forward(motion, [run], [(start.theta, start.velocity)])
        except FitDiverged as error:
            reasons["proposals"] = str(error)
            continue
        speed = np.abs(curve[1])
        moves = np.flatnonzero(speed > MOVING * w0)
        trusted = np.arange(samples) <= (moves[-1] if moves.size else 0)
        if not np.isfinite(curve).all():
            reasons["proposals"] = "the motion leaves the range of numbers"
            continue
        if np.count_nonzero(trusted) < FEWEST:
            reasons["proposals"] = "by the model nothing moves in it"
            continue
        sigma = scale * np.hypot(floor, late * speed)
        length = samples
        if start.drive is not None:
            length = max(round(FORCED_WINDOW_SWINGS * math.tau / w0 / step), 3)
        windows += [
            (len(runs), a, min(a + length, samples), float(curve[0, a]), float(curve[1, a]))
            for a in range(0, samples - 2, length)
        ]
        starts.append(start)
        runs.append(dataclasses.replace(run, sigma=sigma, trusted=trusted))
    return starts, runs, tuple(windows)
