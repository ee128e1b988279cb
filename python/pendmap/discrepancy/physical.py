"""The model of a diagnosis as others can use it: no damping and no friction below 0.

A fit may make a coefficient negative that opposes the motion: it makes up for what the model lacks.
No model has that, and at 0 the other parameters fit no longer. They are fitted again.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Final

from pendmap.discrepancy.held import tried
from pendmap.discrepancy.refit import Found
from pendmap.discrepancy.trial import GENTLE, fitted
from pendmap.errors import InputError

if TYPE_CHECKING:
    from pendmap.discrepancy.evidence import Evidence
    from pendmap.identification.fitting import TrajectoryFit

__all__ = ["physical", "unphysical"]

OPPOSING: Final = ("c_over_m", "Tr")
"""Coefficients of the damping and the friction that oppose the motion wherever it is."""


def unphysical(fit: TrajectoryFit) -> dict[str, float]:
    """Return the coefficients of damping and friction that a fit made negative, with their values.

    No pendulum has them: a negative one feeds the motion. They make up for what the model lacks.
    """
    return {n: fit[n] for n in OPPOSING if n in fit.estimates and fit[n] < 0}


def physical(evidence: Evidence, found: Found) -> Found:
    """Return a model with its negative coefficients at 0, the others fitted again from there.

    Parameters
    ----------
    evidence : Evidence
        The records.
    found : Found
        A model; where none of its coefficients is negative it is given back, and so it is where
        with 0 no fit is found.
    """
    trial = found.trial
    try:
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
        return found if trial is found.trial else Found(trial, tried(evidence, trial))
    except InputError:
        return found
