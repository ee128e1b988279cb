"""The model that a diagnosis gives out, beside the one that fits best."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pendmap.diagnosis.named import values_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.diagnosis.diagnose import Discrepancy
    from pendmap.diagnosis.state import Found

__all__ = ["confined", "given_out", "zeroed"]


def given_out(found: Found) -> dict[str, float]:
    """Return the parameters of the model file, SI; initial states and phases of runs left out."""
    trial = found.trial
    values = {name: value for name, value in trial.start.items() if "[" not in name}
    for effect in trial.fit.model.effects:
        values |= {f"{effect.name}.{name}": value for name, value in effect.parameters.items()}
    for candidate in trial.chosen:
        parameters, _ = values_of(found, candidate)
        values |= {f"{candidate.name}.{name}": value for name, value in parameters.items()}
    return values


def confined(found: Discrepancy) -> Iterator[str]:
    """Yield which effects of the model no map over initial conditions can have."""
    for effect in found.best.trial.fit.model.effects:
        if effect.definition["mappable"] == "no":
            yield f"{effect.name}: allowed in simulate, compare and diagnose; no map has it"


def zeroed(found: Discrepancy) -> Iterator[str]:
    """Yield which coefficients are held at 0."""
    for name in found.best.trial.zeroed:
        yield f"{name} is held at 0: the fit would make it negative, and no pendulum drives itself"
