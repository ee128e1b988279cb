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
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.comparison.data import held_parts
from pendmap.comparison.replay import Motion, replayed
from pendmap.diagnosis.candidates import placed
from pendmap.errors import FitDiverged
from pendmap.formatting import counted
from pendmap.identification.parameters import PER_RUN
from pendmap.identification.runs import FORCED_WINDOW_SWINGS, FitRun
from pendmap.identification.sensitivity import window_slopes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.comparison.data import Evidence
    from pendmap.comparison.further import Reasons
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.next_experiment.proposals import Planned, Proposal, Start
    from pendmap.diagnosis.state import Found
    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.sensitivity import WindowSlopes

    Floats = NDArray[np.float64]
    Windows = tuple[tuple[int, int, int, float, float], ...]

FOLLOWED: Final = 1e-9
"""Directions of the others whose information is less than this part of the greatest are none."""

ALL: Final = 2e-6
"""Where less than this part of a column's information is its own, the others follow all of it."""


@dataclasses.dataclass(frozen=True)
class Information:
    """The information of records about columns."""

    matrix: Floats  # ``X' X``, in SI

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

        ``beside`` follow too; their coefficients are not returned.
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
    """Derivatives at a fit, window by window."""

    shared: tuple[str, ...]  # The fitted parameters that belong to no run alone; the first columns
    # The columns of each further candidate: size, and phase if it has one.
    places: dict[str, list[int]]
    # Columns are those of ``shared`` and the candidates', then those of single runs.
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

        They are taken with the windows of the runs; an effect may be there in several shapes.
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

        ``hold``: stretches of it will be held back, as of records of which no whole run is.
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


PER_SWING: Final = 25.0
"""Samples a small swing at which a proposal is computed, if it would be read more often: fewer
readings of an accordingly smaller error say the same."""

MOVING: Final = 1e-9
"""Velocity over ``w0`` below which a pendulum rests: its readings say no more than the first."""


FEWEST: Final = 3
"""Readings of a run that a fit has at least."""


class Prospects:
    """Proposals run through by the model found, and what they would say.

    A proposal in which the model is lost is left out; ``reasons`` has how many, and why.
    """

    def __init__(
        self,
        evidence: Evidence,
        found: Found,
        menu: Sequence[Proposal],
        candidates: Sequence[Candidate],
        reasons: Reasons,
    ) -> None:
        fit = found.trial.fit
        self.units = fit.model.units
        self.now = Columns.of(fit, evidence.fitted, candidates)
        self.old = self.now.information()
        self._hold = evidence.inside
        longest: dict[Start, float] = {}
        for planned in (run for proposal in menu for run in proposal.runs):
            longest[planned.start] = max(longest.get(planned.start, 0.0), planned.seconds)
        self._starts, runs, windows = _simulated(evidence, found, longest, reasons)
        self.menu = [p for p in menu if all(start in self._starts for start in p.starts)]
        if menu and not self.menu:
            raise FitDiverged(f"of {counted(len(menu), 'proposal')} none: {reasons['proposals']}")
        if len(self.menu) < len(menu):
            reasons["proposals"] = (
                f"{len(menu) - len(self.menu)} of {len(menu)} left out: {reasons['proposals']}"
            )
        self._step = _step(evidence, fit.model.w0)
        ahead = dataclasses.replace(
            fit,
            names=self.now.shared,
            estimates={name: fit.estimates[name] for name in self.now.shared},
            windows=windows,
        )
        self._new = Columns.of(ahead, runs, candidates) if runs else None
        self._known: dict[Planned, Information] = {}

    def after(self, proposal: Proposal) -> Information:
        """Return the information of the records and a proposal together."""
        total = self.old
        for planned in proposal.runs:
            total += self._information(planned)
        return total

    def _information(self, planned: Planned) -> Information:
        if planned not in self._known and self._new is not None:
            self._known[planned] = self._new.information(
                self._starts.index(planned.start),
                round(planned.seconds / self._step) + 1,
                hold=self._hold,
            )
        return self._known[planned]


def _step(evidence: Evidence, w0: float) -> float:
    """Return the time between the samples at which proposals are computed, s."""
    return max(_reading_step(evidence), math.tau / w0 / PER_SWING)


def _reading_step(evidence: Evidence) -> float:
    return float(np.median([np.median(np.diff(run.time)) for run in evidence.fitted]))


def _simulated(
    evidence: Evidence, found: Found, longest: dict[Start, float], reasons: Reasons
) -> tuple[list[Start], list[FitRun], Windows]:
    """Return starts, runs and windows of what the model could be run through."""
    motion, w0 = Motion.of(found.trial.fit), found.trial.fit.model.w0
    step = _step(evidence, w0)
    readings = [evidence.readings[k] for k in evidence.fitted_of]
    floor = float(np.median([reading.sigma for reading in readings]))
    late = float(np.median([0.0 if r.law is None else r.law.tau for r in readings]))
    # Those that are computed take the part of those that are not.
    scale = math.sqrt(_reading_step(evidence) / step)
    starts: list[Start] = []
    runs: list[FitRun] = []
    windows: list[tuple[int, int, int, float, float]] = []
    for start, curve in _curves(motion, longest, step, floor, reasons).items():
        speed = np.abs(curve[1])
        moves = np.flatnonzero(speed > MOVING * w0)
        trusted = np.arange(speed.size) <= (moves[-1] if moves.size else 0)
        if not np.isfinite(curve).all():
            reasons["proposals"] = "the motion leaves the range of numbers"
            continue
        if np.count_nonzero(trusted) < FEWEST:
            reasons["proposals"] = "by the model nothing moves in it"
            continue
        sigma = scale * np.hypot(floor, late * speed)
        run = _run(start, speed.size, step, sigma)
        length = speed.size
        if start.drive is not None:
            length = max(round(FORCED_WINDOW_SWINGS * math.tau / w0 / step), 3)
        windows += [
            (len(runs), a, min(a + length, speed.size), float(curve[0, a]), float(curve[1, a]))
            for a in range(0, speed.size - 2, length)
        ]
        starts.append(start)
        runs.append(dataclasses.replace(run, trusted=trusted))
    return starts, runs, tuple(windows)


def _curves(
    motion: Motion,
    longest: dict[Start, float],
    step: float,
    floor: float,
    reasons: Reasons,
) -> dict[Start, Floats]:
    """Return angle and velocity of each start; without those that leave the range of numbers."""
    runs = {
        start: _run(start, round(seconds / step) + 1, step, floor)
        for start, seconds in longest.items()
    }
    states = {start: (start.theta, start.velocity) for start in runs}
    try:
        every = replayed(motion, list(runs.values()), list(states.values()))
        return {start: curve for start, (_, curve) in zip(runs, every, strict=True)}
    except FitDiverged:
        found = {}
        for start, run in runs.items():
            try:
                found[start] = replayed(motion, [run], [states[start]])[0][1]
            except FitDiverged as error:
                reasons["proposals"] = str(error)
        return found


def _run(start: Start, samples: int, step: float, sigma: float | Floats) -> FitRun:
    time = step * np.arange(samples, dtype=np.float64)
    drive = None if start.drive is None else dict(start.drive)
    return FitRun(time, np.zeros(samples), sigma, drive=drive, lab_time_s=start.lab_time_s)
