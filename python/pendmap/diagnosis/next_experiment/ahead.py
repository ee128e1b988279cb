"""A menu of experiments run through by the model found: what each would say if it were recorded."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.diagnosis.next_experiment.information import Columns, Information
from pendmap.diagnosis.replay import Motion, replayed
from pendmap.errors import InputError
from pendmap.identification.runs import FORCED_WINDOW_SWINGS, FitRun
from pendmap.words import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.data import Evidence
    from pendmap.diagnosis.further import Reasons
    from pendmap.diagnosis.next_experiment.proposals import Planned, Proposal, Start
    from pendmap.diagnosis.state import Found

    Floats = NDArray[np.float64]
    Windows = tuple[tuple[int, int, int, float, float], ...]

__all__ = ["Prospects"]

PER_SWING: Final = 25.0
"""Samples a small swing at which a proposal is computed, if it would be read more often: fewer
readings of an accordingly smaller error say the same."""

MOVING: Final = 1e-9
"""Velocity over ``w0`` below which a pendulum rests: its readings say no more than the first."""


FEWEST: Final = 3
"""Readings of a run that a fit has at least."""


class Prospects:
    """Proposals run through by the model found, and what they would say.

    Parameters
    ----------
    evidence : Evidence
        The records, from which sampling and noise come.
    found : Found
        The model.
    menu : sequence of Proposal
        What might be recorded; one in which the model is lost is left out.
    candidates : sequence of Candidate
        Effects beside those of the model.
    reasons : dict of str to str
        Where it is kept how many are left out, and why.

    Raises
    ------
    InputError
        If the model is lost in all of the menu.
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
            raise InputError(f"of {counted(len(menu), 'proposal')} none: {reasons['proposals']}")
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
    motion, w0 = Motion.of(found), found.trial.fit.model.w0
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
    except InputError:
        found = {}
        for start, run in runs.items():
            try:
                found[start] = replayed(motion, [run], [states[start]])[0][1]
            except InputError as error:
                reasons["proposals"] = str(error)
        return found


def _run(start: Start, samples: int, step: float, sigma: float | Floats) -> FitRun:
    time = step * np.arange(samples, dtype=np.float64)
    drive = None if start.drive is None else dict(start.drive)
    return FitRun(time, np.zeros(samples), sigma, drive=drive, lab_time_s=start.lab_time_s)
