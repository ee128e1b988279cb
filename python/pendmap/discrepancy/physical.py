"""The model of a diagnosis as others can use it: no damping and no friction below 0.

A fit may make a coefficient negative that opposes the motion: it makes up for what the model lacks.
No model has that, and at 0 the other parameters fit no longer. They are fitted again.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Final

from pendmap.discrepancy.further import Reasons, attempted
from pendmap.discrepancy.held import tried
from pendmap.discrepancy.refit import Found
from pendmap.discrepancy.select import Search
from pendmap.discrepancy.trial import GENTLE, fitted
from pendmap.errors import InputError
from pendmap.model.effects import library

if TYPE_CHECKING:
    from collections.abc import Collection

    from pendmap.discrepancy.evidence import Evidence
    from pendmap.discrepancy.trial import Trial
    from pendmap.identification.fitting import TrajectoryFit
    from pendmap.model import Formula

__all__ = ["physical", "unphysical"]

OPPOSING: Final = ("c_over_m", "Tr")
"""Coefficients of the damping and the friction that oppose the motion wherever it is."""

ASTRAY: Final = 1.5
"""So many times the sum of squares is no longer the same explanation without the negative part."""


def unphysical(fit: TrajectoryFit) -> dict[str, float]:
    """Return the coefficients of damping and friction that a fit made negative, with their values.

    No pendulum has them: a negative one feeds the motion. They make up for what the model lacks.
    """
    return {n: fit[n] for n in OPPOSING if n in fit.estimates and fit[n] < 0}


def physical(evidence: Evidence, base: Found, found: Found, own: Collection[Formula] = ()) -> Found:
    """Return a model with its negative coefficients at 0, the others fitted again.

    From the model's own motion on, and where that leads far away from it, as a search among its
    effects that begins at the baseline with the coefficient at 0: how an effect made up for the
    negative one may have had little to do with what it is without.

    Parameters
    ----------
    evidence : Evidence
        The records.
    base : Found
        The model that the search began with.
    found : Found
        A model; where none of its coefficients is negative it is given back. What is found may
        have fewer effects.
    own : collection of Formula
        Candidates of the user's own.

    Raises
    ------
    InputError
        If no fit is found without the negative coefficients.
    """
    if not unphysical(found.trial.fit):
        return found
    reasons: Reasons = {}
    near = attempted(reasons, "near", lambda: _at_zero(evidence, found.trial), None)
    far = None
    if near is None or near.chi2 > ASTRAY * found.trial.chi2:
        far = attempted(
            reasons, "far", lambda: _searched(evidence, base.trial, found.trial, own), None
        )
    fits = [trial for trial in (near, far) if trial is not None]
    if not fits:
        names = " and ".join(unphysical(found.trial.fit))
        raise InputError(
            f"{evidence.experiment.path}: no model without a negative {names} follows these "
            f"records: {reasons['near']}"
        )
    best = min(fits, key=lambda trial: trial.chi2)
    return Found(best, tried(evidence, best))


def _at_zero(evidence: Evidence, trial: Trial) -> Trial:
    """Fit a model again with its negative coefficients at 0, from where the others are."""
    while negative := unphysical(trial.fit):
        zeros: dict[str, Any] = dict.fromkeys(negative, 0.0)
        trial = fitted(
            evidence,
            dataclasses.replace(trial.fit.model, **zeros),
            [name for name in trial.free if name not in negative],
            trial.chosen,
            start={n: v for n, v in trial.start.items() if n not in negative},
            growth=GENTLE,
        )
    return trial


def _searched(evidence: Evidence, base: Trial, trial: Trial, own: Collection[Formula]) -> Trial:
    """Search among a model's effects from the baseline, its negative coefficients at 0."""
    without = [name for name in library() if name not in trial.names]
    formulas = [formula for formula in own if formula.name in trial.names]
    zero: set[str] = set()
    while negative := set(unphysical(trial.fit)) - zero:
        zero |= negative
        zeros: dict[str, Any] = dict.fromkeys(zero, 0.0)
        begin = fitted(
            evidence,
            dataclasses.replace(base.fit.model, **zeros),
            [name for name in base.free if name not in zero],
            start={n: v for n, v in base.start.items() if n not in zero},
            growth=GENTLE,
        )
        again = Search(
            evidence, begin, len(trial.names), without, lambda _found: None, own=formulas
        )
        trial = again.run().trial
    return trial
