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

    from pendmap.identification.runs import FitRun, RodSensor
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
"""What belongs to the drive of one run."""


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A free parameter: its name in SI, the power of ``w0`` that it has, its name in each run.

    ``unit`` is what one of the core's is in SI besides; ``less`` is the free parameter whose value
    is taken off the power.
    """

    name: str
    power: float
    places: list[tuple[int, str]]
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
        Names as in :func:`pendmap.identification.fit.fit_runs`; a phase that a run does not
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
                raise InputError(f"free must be among {known}, got {short_repr(name)}")
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
    own = [Quantity(f"bias{which}", 0, [(k, "bias")], math.nan, sensor.unit)]
    if sensor.leans:
        own.append(Quantity(f"tilt{which}", 0, [(k, "tilt")], math.nan))
    return own


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
    """Return a parameter's power of ``w0``, and what is taken off it, if that is free too."""
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


def _value_of(quantity: Quantity, rigs: Sequence[Rig]) -> float:
    rig = rigs[quantity.places[0][0]]
    name = quantity.name.partition("[")[0]
    if name in SENSOR:
        return 0.0
    if name in PLACES:
        return float(getattr(rig, name))
    found = _effect(name, rig)
    return math.nan if found is None else found[0].parameters[found[1]]


# Free parameters as the core counts them, and in SI.
#
# The core counts time in ``1 / w_ref`` of a fixed ``w_ref``, and ``w0`` is a factor ``xi`` on
# gravity
# there. In SI
#
# ``w0 = w_ref sqrt(xi)``, ``x = u w_ref^k xi`` of all others.
#
# The power ``k`` of a size whose unit depends on an exponent ``n`` is ``2 - n``. Where both are
# free
# the Jacobian ``dx / dxi`` has ``dq / dn = -ln(w_ref) q`` beside its diagonal.


@dataclasses.dataclass(frozen=True)
class Conversion:
    """Conversion of the free parameters of a fit.

    Parameters
    ----------
    quantities : sequence of Quantity
        The parameters.
    units : Units
        SI, with ``w_ref`` for their ``w0``.
    """

    quantities: Sequence[Quantity]
    units: Units

    @property
    def names(self) -> tuple[str, ...]:
        """What the parameters are called."""
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
        """Return in SI what the core calls ``values``, shape (k,)."""
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

        Variances are infinite of what the records do not show, and of what is computed from it.
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
        """The places of sizes whose unit is free too: no number of the core's is such a size."""
        return tuple(self._exponents)

    @property
    def _exponents(self) -> dict[int, int]:
        """The place of the exponent of each size whose unit depends on a free one."""
        places = {name: k for k, name in enumerate(self.names)}
        return {k: places[q.less] for k, q in enumerate(self.quantities) if q.less is not None}

    def _scales(self, values: ArrayLike) -> Floats:
        """Return what one of the core's is in SI; an exponent is the same number in both."""
        powers = np.array([q.power for q in self.quantities], np.float64)
        for size, exponent in self._exponents.items():
            powers[size] -= np.asarray(values, np.float64)[exponent]
        units = np.array([q.unit for q in self.quantities], np.float64)
        return np.asarray(units * self.units.w0**powers, np.float64)


def interval(value: float, half: float, *, mixed: bool) -> tuple[float, float]:
    """Return a value less and more ``half`` of its interval; no numbers where that is not finite.

    Of a size whose unit is free too, in equal ratios: what records tell is ``q v^n`` at their
    velocities ``v``, so that ``ln q`` and ``n`` vary together, and nearly normally.
    """
    if not math.isfinite(half):
        return math.nan, math.nan
    if not mixed or value == 0:
        return value - half, value + half
    ratio = min(half / abs(value), 300.0)  # beyond it nothing is known
    low, high = sorted((value * math.exp(-ratio), value * math.exp(ratio)))
    return low, high
