"""The model that a diagnosis gives out, beside the one that fits best."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pendmap.discrepancy.named import values_of
from pendmap.discrepancy.physical import unphysical
from pendmap.model.unit_names import unit_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.discrepancy.diagnose import Discrepancy
    from pendmap.discrepancy.refit import Found

__all__ = ["confined", "feeding", "given_out"]


def given_out(usable: Found) -> dict[str, float]:
    """Return the parameters of the model file, SI; initial states and phases of runs left out."""
    trial = usable.trial
    values = {name: value for name, value in trial.start.items() if "[" not in name}
    for effect in trial.fit.model.effects:
        values |= {f"{effect.name}.{name}": value for name, value in effect.parameters.items()}
    for candidate in trial.chosen:
        parameters, _ = values_of(usable, candidate)
        values |= {f"{candidate.name}.{name}": value for name, value in parameters.items()}
    return values


def confined(found: Discrepancy) -> Iterator[str]:
    """Yield which effects of the model no map over initial conditions can have."""
    for effect in (found.usable or found.best).trial.fit.model.effects:
        if effect.definition["mappable"] == "no":
            yield f"{effect.name}: allowed in simulate, compare and diagnose; no map has it"


def feeding(found: Discrepancy) -> Iterator[str]:
    """Yield which coefficients of damping and friction are negative, and what the file has then."""
    negative = unphysical(found.best.trial.fit)
    for name, value in negative.items():
        yield (
            f"{name} is {value:.3g} {unit_of(name, found.definition)}, unphysical: no pendulum "
            "feeds its own motion"
        )
    if {"c_over_m", "Tr"} <= negative.keys():
        yield "  both damping and friction are: the record may run backwards in time"
    if negative and found.usable is not None:
        given = ", ".join(
            f"{name} = {value:.4g} {unit_of(name, found.definition)}".rstrip()
            for name, value in given_out(found.usable).items()
        )
        yield (
            f"  the model file has 0 there, the rest found again: {given}; residual "
            f"{found.usable.trial.fit.rms:.4g} rad"
        )
    for name, since in found.below_zero.items():
        yield (
            f"{name} is below 0 from {since:.3g} s in the laboratory on, by what drifts: "
            "unphysical, the drift stands for something else"
        )
