"""Free parameters: their names in SI, and where they stand in the core's list."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

from pendmap import checks
from pendmap.errors import InputError
from pendmap.model.rig import COUNTERPARTS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.identification.runs import FitRun, RodSensor
    from pendmap.model import Rig
    from pendmap.model.effects import Effect

__all__ = ["PER_RUN", "PLACES", "SENSOR", "Quantity", "free_quantities"]

PLACES: Final[Mapping[str, int]] = {
    "w0": -1,
    "c_over_m": 0,
    "Tr": 1,
    "torque": 2,
    "p": 3,
    "Omega": 4,
    "phi": 5,
}
"""Places in the core's list of parameters; those of effects follow. -1 is gravity."""

SENSOR: Final[Mapping[str, int]] = {"bias": -2, "tilt": -3}
"""The same of the own of a sensor on the rod, run by run: they are always fitted."""

PER_RUN: Final = ("p", "Omega", "phi")
"""What belongs to the drive of one run."""


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A free parameter: its name in SI, the power of ``w0`` that it has, where it stands.

    ``unit`` is what one of the core's is in SI besides; ``less`` is the free parameter whose value
    is taken off the power.
    """

    name: str
    power: float
    places: list[tuple[int, int]]
    start: float
    unit: float = 1.0
    less: str | None = None

    @property
    def is_w0(self) -> bool:
        """Whether it is ``w0``, in the core a factor on gravity."""
        return self.name == "w0"


def free_quantities(
    runs: Sequence[FitRun],
    rigs: Sequence[Rig],
    free: Sequence[str],
    start: Mapping[str, float],
) -> list[Quantity]:
    """Return the free parameters of runs, whose rigs are given.

    Parameters
    ----------
    runs, rigs : sequence
        The records and the pendulum of each.
    free : sequence of str
        Names as in :func:`pendmap.identification.fitting.fit_runs`; a phase that a run does not
        know is added, and so are bias and tilt of a sensor on the rod.
    start : mapping of str to float
        Starts other than the rigs' values.

    Raises
    ------
    InputError
        If a name is not known.
    """
    names = list(dict.fromkeys(free))
    unknown_phase = [k for k, run in enumerate(runs) if run.drive and run.drive.get("phi") is None]
    quantities = []
    for name in names:
        known = f"{', '.join(PLACES)} and effect.parameter of the model's effects"
        if name in PER_RUN:
            driven = [k for k, run in enumerate(runs) if run.drive is not None]
            parts = [(f"{name}[{k}]" if len(runs) > 1 else name, [k]) for k in driven]
        else:
            parts = [(name, list(range(len(runs))))]
        for own, where in parts:
            places = [(k, place) for k in where if (place := _place_of(name, rigs[k])) is not None]
            if not places:
                raise InputError(f"free must be among {known}, got {checks.shown(name)}")
            power, less = _power_of(name, rigs[places[0][0]], names)
            quantities.append(Quantity(own, power, places, math.nan, less=less))
    if "phi" not in names:
        quantities += [
            Quantity(f"phi[{k}]" if len(runs) > 1 else "phi", 0, [(k, PLACES["phi"])], math.nan)
            for k in unknown_phase
        ]
    for k, run in enumerate(runs):
        if run.rod_sensor is not None:
            quantities += _of_sensor(run.rod_sensor, k, f"[{k}]" if len(runs) > 1 else "")
    return [
        dataclasses.replace(
            q, start=start.get(q.name, start.get(q.name.partition("[")[0], _value_of(q, rigs)))
        )
        for q in quantities
    ]


def _of_sensor(sensor: RodSensor, k: int, which: str) -> list[Quantity]:
    """Return what is not known of a sensor on the rod: its reading of nothing, and how it leans."""
    own = [Quantity(f"bias{which}", 0, [(k, SENSOR["bias"])], math.nan, sensor.unit)]
    if sensor.leans:
        own.append(Quantity(f"tilt{which}", 0, [(k, SENSOR["tilt"])], math.nan))
    return own


def _effect(name: str, rig: Rig) -> tuple[int, Effect, str] | None:
    """Return an effect's first place, the effect and the parameter, by ``effect.parameter``."""
    place = len(PLACES) - 1
    effect_name, _, parameter = name.rpartition(".")
    for effect in rig.effects:
        if effect.name == effect_name and parameter in effect.parameters:
            return place, effect, parameter
        place += len(effect.parameters)
    return None


def _place_of(name: str, rig: Rig) -> int | None:
    if name in PLACES:
        return PLACES[name]
    found = _effect(name, rig)
    return None if found is None else found[0] + list(found[1].parameters).index(found[2])


def _power_of(name: str, rig: Rig, free: Sequence[str]) -> tuple[float, str | None]:
    """Return a parameter's power of ``w0``, and what is taken off it, if that is free too."""
    if name == "w0":
        return 1, None
    own = dict(COUNTERPARTS.values())
    if name in own:
        return own[name], None
    found = _effect(name, rig)
    if found is None:
        raise InputError(f"free has {checks.shown(name)}: the model has no such effect")
    _, effect, parameter = found
    entry = next(e for e in effect.definition["parameters"] if e["name"] == parameter)
    less = entry["power_of_w0_less"]
    if less is None:
        return float(entry["power_of_w0"]), None
    if f"{effect.name}.{less}" in free:
        return float(entry["power_of_w0"]), f"{effect.name}.{less}"
    return float(entry["power_of_w0"] - effect.parameters[less]), None


def _value_of(quantity: Quantity, rigs: Sequence[Rig]) -> float:
    rig = rigs[quantity.places[0][0]]
    name = quantity.name.partition("[")[0]
    if name in SENSOR:
        return 0.0
    if name in PLACES:
        return float(getattr(rig, name))
    found = _effect(name, rig)
    return math.nan if found is None else found[1].parameters[found[2]]
