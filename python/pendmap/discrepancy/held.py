"""A fitted model tried on what was held back."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from pendmap.discrepancy.trial import FEW_STEPS, LITTLE
from pendmap.identification.fitting import TrajectoryFit, fit_runs

if TYPE_CHECKING:
    from pendmap.discrepancy.evidence import Evidence
    from pendmap.discrepancy.trial import Trial

__all__ = ["Held", "tried"]


@dataclasses.dataclass(frozen=True)
class Held:
    """A model on the records held back, its parameters as they were fitted to the others.

    Parameters
    ----------
    chi2 : float
        Sum of squared residuals over standard errors, initial states adapted.
    degrees : int
        Samples less what was adapted.
    fit : TrajectoryFit
        Curves and residuals.
    """

    chi2: float
    degrees: int
    fit: TrajectoryFit


def tried(evidence: Evidence, trial: Trial) -> Held:
    """Try a model on what was held back.

    Whole runs have fresh initial states; stretches within a fitted run are passed through by the
    motion that was fitted to the rest of it.

    Parameters
    ----------
    evidence : Evidence
        The records.
    trial : Trial
        The model.
    """
    model, free = trial.fit.model, trial.free
    if not evidence.inside:
        known = {name: value for name, value in trial.start.items() if "[" not in name}
        fit = fit_runs(
            evidence.held,
            model,
            free,
            start=known,
            profiled=(),
            hold=True,
            steps=FEW_STEPS,
            least_gain=LITTLE,
        )
        adapted = 2 * len(fit.windows) + len([n for n in fit.names if n.startswith("phi")])
        return Held(fit.chi2, max(fit.samples - adapted, 1), fit)
    places = {of: k for k, of in enumerate(evidence.held_of)}
    windows = tuple((places[w[0]], *w[1:]) for w in trial.fit.windows if w[0] in places)
    known = {name: value for name, value in trial.start.items() if "[" not in name}
    own = [name for name in free if name in known]
    # No step: neither parameters nor states are adapted.
    fit = fit_runs(
        evidence.held, model, own, start=known, windows=windows, profiled=(), hold=True, steps=0
    )
    return Held(fit.chi2, max(fit.samples, 1), fit)
