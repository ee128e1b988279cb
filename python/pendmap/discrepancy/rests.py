"""What stays of a model without one of its effects, or with another one in its place."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.discrepancy.candidates import Candidate, placed
from pendmap.discrepancy.refit import KICK, Key, Refits, key_of
from pendmap.discrepancy.trial import (
    LITTLE,
    Trial,
    fitted,
    settled,
    with_candidates,
)
from pendmap.errors import InputError
from pendmap.identification.fitting import TrajectoryFit, fit_runs

if TYPE_CHECKING:
    from pendmap.discrepancy.evidence import Evidence
    from pendmap.discrepancy.scores import Score
    from pendmap.discrepancy.trial import Windows
    from pendmap.model import Rig

__all__ = ["Rests", "consistent"]

ALIKE: Final = 1.5
"""Wald's test and the fall of a sum of squares differ by this factor where all is not linear."""

FAINT: Final = 5.0
"""Standard errors within which what stays follows the covariance when an effect is dropped."""

LESS_STEPS: Final = 16
"""Steps of a fit without one of the effects: beyond them a model that is wrong only creeps."""

NEAR: Final = 0.1
"""Part of all that was gained: an effect without which less is lost may be idle, and what stays is
fitted to the end."""


class Rests:
    """Fits without one of the effects that were added; what was computed once is not again.

    Parameters
    ----------
    evidence : Evidence
        The records.
    base : Trial
        The model that the search began with.
    refits : Refits
        The fits of candidates that were made.
    """

    def __init__(self, evidence: Evidence, base: Trial, refits: Refits) -> None:
        self.base = base
        self._evidence = evidence
        self._refits = refits
        self._known: dict[Key, Trial] = {}
        self._gone: set[tuple[Key, Key]] = set()
        self.keep(base)

    def keep(self, trial: Trial) -> None:
        """Remember a fit: a larger model's rest may be the same."""
        self._known[key_of(trial.chosen)] = trial

    def less(self, trial: Trial, dropped: Candidate) -> Trial:
        """Fit a trial's model without one of the effects that were added."""
        chosen = tuple(c for c in trial.chosen if c.name != dropped.name)
        key = key_of(chosen)
        known, way = self._known.get(key), (key, key_of(trial.chosen))
        if known is None or (
            # It was found on another way, and is in the wrong valley if this one's size says so.
            chosen and way not in self._gone and not consistent(known, trial, dropped)
        ):
            self._gone.add(way)
            rest = self._rest(trial, dropped, chosen)
            # Of the baseline where nothing that has the effects is better.
            self._known[key] = rest if known is None else min((known, rest), key=lambda t: t.chi2)
        return self._known[key]

    def _rest(self, trial: Trial, dropped: Candidate, chosen: tuple[Candidate, ...]) -> Trial:
        """Return the best fit of the effects that stay: from with the other one, or without it.

        Where much is missing a fit that begins at a good model's windows may be lost.
        """
        known = self._refits.known(self.base, chosen)
        if known is not None and known.fit.converged and consistent(known, trial, dropped):
            return known
        rest = self.fit_without(trial, dropped, chosen, known)
        if known is not None:
            rest = min((rest, known), key=lambda t: t.chi2)
        elif not rest.fit.converged:
            rest = self._refits.unslipped(rest, gently=True)
        if rest.chi2 - trial.chi2 < NEAR * (self.base.chi2 - trial.chi2):
            rest = self._settled(rest)
        if rest.chi2 <= self.base.chi2:
            return rest
        # It can do all that the baseline does: it was lost, and begins again from there.
        return min((rest, self._from_base(trial, chosen)), key=lambda t: t.chi2)

    def _settled(self, rest: Trial) -> Trial:
        try:
            return settled(self._evidence, rest)
        except InputError:
            return rest

    def _from_base(self, trial: Trial, chosen: tuple[Candidate, ...]) -> Trial:
        """Fit some of a trial's effects from the baseline, where they are nearly nothing."""
        sizes = {candidate.free[0] for candidate in chosen}
        own = [name for c in chosen for name in (*c.free, *c.adapted)]
        start = {n: trial.start[n] * (KICK if n in sizes else 1.0) for n in own}
        try:
            return with_candidates(self._evidence, self.base, chosen, start)
        except InputError:
            return self.base

    def fit_without(
        self,
        trial: Trial,
        dropped: Candidate,
        chosen: tuple[Candidate, ...],
        known: Trial | None = None,
    ) -> Trial:
        """Fit a trial's model without an effect, with those that stay, from its own motion.

        A fit of the same that is known and better is given back.
        """
        model, free, start = _without(trial, dropped)
        windows = trial.fit.windows
        try:
            rest = self._fit(model, free, chosen, start, windows)
        except InputError:
            # Without it the motion is lost from here: from short windows on, as the baseline began.
            begin = start | {n: v for n, v in self.base.start.items() if n in free}
            return fitted(self._evidence, model, free, chosen, start=begin)
        if rest.fit.converged:
            return rest
        if known is not None and known.fit.converged and known.chi2 < rest.chi2:
            return known
        try:
            # Initial states first: a step of all from states that are another motion's leads away.
            near = _following(self._evidence, model, free, start, windows)
            if near.chi2 > self.base.chi2:
                return rest  # the other parameters are not near either
            other = self._fit(model, free, chosen, start, near.windows)
        except InputError:
            return rest
        return min((rest, other), key=lambda t: t.chi2)

    def _fit(
        self,
        model: Rig,
        free: list[str],
        chosen: tuple[Candidate, ...],
        start: dict[str, float],
        windows: Windows,
    ) -> Trial:
        return fitted(
            self._evidence,
            model,
            free,
            chosen,
            start=start,
            windows=windows,
            steps=LESS_STEPS,
            least_gain=LITTLE,
        )

    def instead(
        self, trial: Trial, dropped: Candidate, score: Score, target: float = math.inf
    ) -> Trial | None:
        """Fit a trial's model with another effect in an effect's place, that does nearly the same.

        It begins at the trial's own motion, and is given up where it promises far less than the
        target.
        """
        model, free, start = _without(trial, dropped)
        other = score.candidate
        chosen = (*(c for c in trial.chosen if c.name != dropped.name), other)
        try:
            return fitted(
                self._evidence,
                placed(model, [other]),
                [*free, *other.free, *other.adapted],
                chosen,
                start=start | score.start,
                windows=trial.fit.windows,
                target=target,
            )
        except InputError:
            return None


def _following(
    evidence: Evidence,
    model: Rig,
    free: list[str],
    start: dict[str, float],
    windows: Windows,
) -> TrajectoryFit:
    """Return the fit of the initial states to a model's parameters, which are held."""
    return fit_runs(
        evidence.fitted,
        model,
        free,
        start=start,
        windows=windows,
        profiled=(),
        hold=True,
        steps=LESS_STEPS,
        least_gain=LITTLE,
    )


def consistent(rest: Trial, trial: Trial, candidate: Candidate) -> bool:
    """Whether an effect gains no more than its size over its standard error says (Wald's test).

    Where the fit without it is in the wrong valley it gains far more.
    """
    size = trial.fit.estimates[candidate.free[0]]
    fall = rest.chi2 - trial.chi2
    return bool(size.stderr and fall < ALIKE * (size.value / size.stderr) ** 2)


def _without(trial: Trial, dropped: Candidate) -> tuple[Rig, list[str], dict[str, float]]:
    """Return a trial's model without an effect, what is free of it, and where it stands."""
    gone = {*dropped.free, *dropped.adapted}
    model = trial.fit.model
    own: dict[str, Any] = {name: 0.0 for name in gone if name in {"Tr", "torque"}}
    effects = tuple(e for e in model.effects if e.name != dropped.name)
    model = dataclasses.replace(model, effects=effects, **own)
    free = [name for name in trial.free if name not in gone]
    start = trial.start
    if (faint := _faint(trial, dropped)) is not None:
        # What it took up goes where the covariance says: without that the motion may be lost.
        column = trial.fit.covariance[:, faint]
        share = start[trial.fit.names[faint]] / column[faint]
        start = {n: start[n] - share * c for n, c in zip(trial.fit.names, column, strict=True)}
    return model, free, {name: value for name, value in start.items() if name not in gone}


def _faint(trial: Trial, dropped: Candidate) -> int | None:
    """Return where the size of an effect stands that is little beside its standard error."""
    size = dropped.free[0]
    if size not in trial.fit.names or dropped.phase is not None:
        return None
    error = trial.fit.estimates[size].stderr
    if not np.isfinite(trial.fit.covariance).all():
        return None  # nothing says where what it took up goes
    if not error or abs(trial.start[size]) > FAINT * error:
        return None
    return trial.fit.names.index(size)
