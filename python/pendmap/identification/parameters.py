"""Free parameters: their names in SI and in the core."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError, short_repr
from pendmap.model.quantities import COUNTERPARTS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig
    from pendmap.model.effects import Effect
    from pendmap.units import Units

    Floats = NDArray[np.float64]


PLACES: Final[Mapping[str, str]] = {
    "w0": "gravity",
    "c_over_m": "gamma",
    "Tr": "theta_r",
    "torque": "torque",
    "p": "p",
    "Omega": "omega",
    "phi": "phase",
}
"""Names in the core of a rig's parameters; those of effects have one name in both."""

SENSOR: Final = ("bias", "tilt")
"""Parameters of a sensor on the rod, run by run: they are always fitted."""

PER_RUN: Final = ("p", "Omega", "phi")
"""Parameters of the drive of one run."""


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A free parameter."""

    name: str  # in SI
    power: float  # of w0 in the SI value
    places: list[tuple[int, str]]  # run and place
    start: float
    unit: float = 1.0  # further factor of the SI value
    less: str | None = None  # free parameter whose value is subtracted from the power

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
    """Return the free parameters of runs whose rigs are given.

    ``free`` has names as of :func:`pendmap.identification.fit.fit_runs`; a phase that a run does
    not know is added, and so are bias and tilt of a sensor on the rod. ``start`` has starting
    values that replace the rigs'.
    """
    names = list(dict.fromkeys(free))
    known = f"{', '.join(PLACES)} and effect.parameter of the model's effects"
    quantities = []

    def add(
        name: str,
        places: list[tuple[int, str]],
        power: float = 0,
        unit: float = 1.0,
        less: str | None = None,
    ) -> None:
        begin = start.get(name.partition("[")[0], _value_of(name, rigs[places[0][0]]))
        quantities.append(Quantity(name, power, places, start.get(name, begin), unit, less))

    of_run = [f"[{k}]" if len(runs) > 1 else "" for k in range(len(runs))]
    for name in names:
        if name in PER_RUN:
            driven = [k for k, run in enumerate(runs) if run.drive is not None]
            parts = [(name + of_run[k], [k]) for k in driven]
        else:
            parts = [(name, list(range(len(runs))))]
        for own, where in parts:
            places = [(k, place) for k in where if (place := _place_of(name, rigs[k])) is not None]
            if not places:
                raise InputError(f"free must be among {known}, got {short_repr(name)}")
            power, less = _power_of(name, rigs[places[0][0]], names)
            add(own, places, power, less=less)
    unknown = [k for k, run in enumerate(runs) if run.drive and run.drive.get("phi") is None]
    for k in unknown if "phi" not in names else []:
        add("phi" + of_run[k], [(k, PLACES["phi"])])
    sensors = [(k, run.rod_sensor) for k, run in enumerate(runs) if run.rod_sensor is not None]
    for k, sensor in sensors:
        add("bias" + of_run[k], [(k, "bias")], unit=sensor.unit)
        if sensor.leans:
            add("tilt" + of_run[k], [(k, "tilt")])
    return quantities


def _effect(name: str, rig: Rig) -> tuple[Effect, str] | None:
    """Return the effect and the parameter of ``effect.parameter``."""
    effect_name, _, parameter = name.rpartition(".")
    for effect in rig.effects:
        if effect.name == effect_name and parameter in effect.parameters:
            return effect, parameter
    return None


def _place_of(name: str, rig: Rig) -> str | None:
    return PLACES.get(name, None if _effect(name, rig) is None else name)


def _power_of(name: str, rig: Rig, free: Sequence[str]) -> tuple[float, str | None]:
    """Return a parameter's power of ``w0``, and the free exponent subtracted from it, if any."""
    if name == "w0":
        return 1, None
    own = dict(COUNTERPARTS.values())
    if name in own:
        return own[name], None
    found = _effect(name, rig)
    if found is None:
        raise InputError(f"free has {short_repr(name)}: the model has no such effect")
    effect, parameter = found
    entry = next(e for e in effect.definition["parameters"] if e["name"] == parameter)
    less = entry["power_of_w0_less"]
    if less is None:
        return float(entry["power_of_w0"]), None
    if f"{effect.name}.{less}" in free:
        return float(entry["power_of_w0"]), f"{effect.name}.{less}"
    return float(entry["power_of_w0"] - effect.parameters[less]), None


def _value_of(name: str, rig: Rig) -> float:
    name = name.partition("[")[0]
    if name in SENSOR:
        return 0.0
    if name in PLACES:
        return float(getattr(rig, name))
    found = _effect(name, rig)
    return math.nan if found is None else found[0].parameters[found[1]]


@dataclasses.dataclass(frozen=True)
class Conversion:
    """Conversion of a fit's free parameters between SI and the core.

    The core counts time in ``1 / w_ref`` of a fixed ``w_ref``, and ``w0`` is a factor ``xi`` on
    gravity. In SI ``w0 = w_ref sqrt(xi)``, and ``x = u w_ref^k xi`` of all others. The power ``k``
    of a size whose unit depends on an exponent ``n`` is ``2 - n``; where both are free the Jacobian
    ``dx / dxi`` has ``dq / dn = -ln(w_ref) q`` beside its diagonal.
    """

    quantities: Sequence[Quantity]
    units: Units  # SI, with w_ref for their w0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(q.name for q in self.quantities)

    @property
    def start(self) -> list[tuple[list[tuple[int, str]], float]]:
        """Names and start of each, as the core takes them."""
        starts = [q.start for q in self.quantities]
        scales = self._scales(starts)
        return [
            (q.places, (q.start / self.units.w0) ** 2 if q.is_w0 else q.start / scale)
            for q, scale in zip(self.quantities, scales, strict=True)
        ]

    def given(self, values: ArrayLike) -> Floats:
        """Return in SI the core's ``values``, shape (k,)."""
        bare = np.asarray(values, np.float64)
        roots = np.sqrt(np.where(bare > 0, bare, np.nan))
        first = np.array([q.is_w0 for q in self.quantities], bool)
        return np.where(first, self.units.w0 * roots, self._scales(bare) * bare)

    def jacobian(self, values: ArrayLike) -> Floats:
        """Return the derivatives of :meth:`given`, shape (k, k): of rows, by columns."""
        given = self.given(values)
        slopes = self._scales(values)
        for k, q in enumerate(self.quantities):
            if q.is_w0:
                slopes[k] = self.units.w0**2 / (2 * given[k])
        found = np.diag(slopes)
        for size, exponent in self._exponents.items():
            found[size, exponent] = -math.log(self.units.w0) * given[size]
        return found

    def columns(self, bare: Floats, values: ArrayLike) -> Floats:
        """Return derivatives by the parameters in SI, shape (n, k), from those by the core's."""
        return np.asarray(bare @ np.linalg.inv(self.jacobian(values)), np.float64)

    def covariance(self, bare: Floats, values: ArrayLike) -> Floats:
        """Return the covariance in SI, shape (k, k), from the core's.

        Variances are infinite of parameters that the records do not determine, and of those that
        follow.
        """
        slopes = self.jacobian(values)
        known = np.where(np.isfinite(bare), bare, 0.0)
        found = slopes @ known @ slopes.T
        unseen = ~np.isfinite(np.diag(bare))
        through = (slopes[:, unseen] != 0).any(axis=1)
        found[through, through] = np.inf
        return np.asarray(found, np.float64)

    @property
    def mixed(self) -> tuple[int, ...]:
        """Places of sizes whose unit depends on a free exponent."""
        return tuple(self._exponents)

    @property
    def _exponents(self) -> dict[int, int]:
        """Place of the exponent of each size whose unit depends on a free one."""
        places = {name: k for k, name in enumerate(self.names)}
        return {k: places[q.less] for k, q in enumerate(self.quantities) if q.less is not None}

    def _scales(self, values: ArrayLike) -> Floats:
        """Return the SI value of one unit of the core's; an exponent is the same in both."""
        powers = np.array([q.power for q in self.quantities], np.float64)
        for size, exponent in self._exponents.items():
            powers[size] -= np.asarray(values, np.float64)[exponent]
        units = np.array([q.unit for q in self.quantities], np.float64)
        return np.asarray(units * self.units.w0**powers, np.float64)


def interval(value: float, half: float, *, mixed: bool) -> tuple[float, float]:
    """Return the ends of ``value +- half``; NaN where ``half`` is not finite.

    ``mixed``, of a size whose unit is free too, in equal ratios: records determine ``q v^n`` at
    their velocities ``v``, so that ``ln q`` and ``n`` vary together, nearly normally.
    """
    if not math.isfinite(half):
        return math.nan, math.nan
    if not mixed or value == 0:
        return value - half, value + half
    ratio = min(half / abs(value), 300.0)  # beyond it nothing is known
    low, high = sorted((value * math.exp(-ratio), value * math.exp(ratio)))
    return low, high
