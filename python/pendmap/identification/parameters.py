"""Free parameters of a fit and their conversion between SI and the core."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError, short_repr
from pendmap.model.quantities import COUNTERPARTS
from pendmap.signal.robust import Z95

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import ArrayLike

    from pendmap.identification.runs import FitRun
    from pendmap.model import Effect, Rig
    from pendmap.signal import Floats
    from pendmap.units import Units


PLACES: Final[Mapping[str, tuple[str, float]]] = {"w0": ("gravity", 1)} | {
    si: (bare, power) for bare, (si, power) in COUNTERPARTS.items() if bare != "lab_time"
}
"""Name in the core of each parameter of a rig, and the power of ``w0`` in its SI value."""

SENSOR: Final = "bias"  # Parameter of a gyroscope, always fitted run by run
OPPOSING: Final = ("c_over_m", "Tr")  # Coefficients that oppose the motion and are at least 0
OFFSET: Final = "encoder_offset"  # Effect that is the sensor's zero error
PER_RUN: Final = ("p", "Omega", "phi")  # Parameters of the drive of one run


def opposing(effects: Iterable[Effect]) -> list[str]:
    """Return the coefficients that are at least 0: those of damping, and sizes of effects."""
    sizes = [f"{e.name}.{size}" for e in effects if (size := e.definition.opposing) is not None]
    return [*OPPOSING, *sizes]


@dataclasses.dataclass(frozen=True)
class Quantity:
    """Free parameter of a fit."""

    name: str  # in SI
    power: float  # power of w0 in the SI value
    places: list[tuple[int, str]]  # run and name in the core
    start: float
    unit: float = 1.0  # further factor of the SI value
    less: str | None = None  # free exponent that is subtracted from the power


def free_quantities(
    runs: Sequence[FitRun], rigs: Sequence[Rig], free: Sequence[str], start: Mapping[str, float]
) -> list[Quantity]:
    """Return the free parameters of a fit to runs with given rigs.

    ``free`` has names as in :func:`pendmap.identification.fit.fit_runs`; unknown phases, and the
    bias of gyroscopes, are added. ``start`` has starting values that replace the
    rigs'.
    """
    names = list(dict.fromkeys(free))
    of_run = [f"[{k}]" if len(runs) > 1 else "" for k in range(len(runs))]
    wanted: list[tuple[str, str, Sequence[int]]] = []
    for name in names:
        if name in PER_RUN:
            driven = [k for k, run in enumerate(runs) if run.drive is not None]
            wanted += [(name, of_run[k], [k]) for k in driven]
        else:
            wanted.append((name, "", range(len(runs))))
    if "phi" not in names:
        unknown = [k for k, run in enumerate(runs) if run.drive and run.drive.get("phi") is None]
        wanted += [("phi", of_run[k], [k]) for k in unknown]
    quantities = []
    for name, suffix, where in wanted:
        entries = {
            k: entry for k in where if (entry := _found_in(rigs[k], name, names)) is not None
        }
        if not entries:
            known = f"{', '.join(PLACES)} and effect.parameter of the model's effects"
            raise InputError(f"free must be among {known}, got {short_repr(name)}")
        _, power, less, value = next(iter(entries.values()))
        begin = start.get(name + suffix, start.get(name, value))
        places = [(k, place) for k, (place, *_) in entries.items()]
        quantities.append(Quantity(name + suffix, power, places, begin, less=less))
    for k, run in enumerate(runs):
        if run.rod_sensor is None:
            continue
        begin = start.get(SENSOR + of_run[k], start.get(SENSOR, 0.0))
        unit = run.rod_sensor.unit
        quantities.append(Quantity(SENSOR + of_run[k], 0, [(k, SENSOR)], begin, unit))
    return quantities


def _found_in(
    rig: Rig, name: str, free: Sequence[str]
) -> tuple[str, float, str | None, float] | None:
    """Return a parameter's name in the core, power of ``w0``, exponent subtracted and value."""
    if name in PLACES:
        return *PLACES[name], None, float(getattr(rig, name))
    effect_name, _, parameter = name.rpartition(".")
    effects = (e for e in rig.effects if e.name == effect_name and parameter in e.parameters)
    effect = next(effects, None)
    if effect is None:
        return None
    entry = effect.definition[parameter]
    power, less = float(entry.power_of_w0), entry.power_of_w0_less
    exponent = None if less is None else f"{effect_name}.{less}"
    if less is not None and exponent not in free:
        power, exponent = power - effect.parameters[less], None
    return name, power, exponent, effect.parameters[parameter]


@dataclasses.dataclass(frozen=True)
class Conversion:
    """Conversion of a fit's free parameters between SI and the core.

    The core's unit of time is ``1 / w_ref`` with a fixed ``w_ref``. Its parameter ``xi`` for ``w0``
    is a factor on gravity: ``w0 = w_ref sqrt(xi)``; all others have ``x = u w_ref^k xi``. The power
    ``k`` of a size whose unit depends on an exponent ``n`` is ``2 - n``; if both are free the
    Jacobian ``dx / dxi`` has the off-diagonal element ``dq / dn = -ln(w_ref) q``.
    """

    quantities: Sequence[Quantity]
    units: Units  # SI, with w_ref for their w0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(q.name for q in self.quantities)

    @property
    def start(self) -> list[tuple[list[tuple[int, str]], float]]:
        """Runs and names, and starting value, of each parameter in the core's units."""
        starts = [q.start for q in self.quantities]
        scales = self._scales(starts)
        return [
            (q.places, (q.start / self.units.w0) ** 2 if q.name == "w0" else q.start / scale)
            for q, scale in zip(self.quantities, scales, strict=True)
        ]

    def given(self, values: ArrayLike) -> Floats:
        """Return the core's ``values`` in SI, shape (k,)."""
        bare = np.asarray(values, np.float64)
        roots = np.sqrt(np.where(bare > 0, bare, np.nan))
        first = np.array([q.name == "w0" for q in self.quantities], bool)
        return np.where(first, self.units.w0 * roots, self._scales(bare) * bare)

    def jacobian(self, values: ArrayLike) -> Floats:
        """Return the Jacobian of :meth:`given`, shape (k, k)."""
        given = self.given(values)
        slopes = self._scales(values)
        for k, q in enumerate(self.quantities):
            if q.name == "w0":
                slopes[k] = self.units.w0**2 / (2 * given[k])
        matrix = np.diag(slopes)
        for size, exponent in self._exponents.items():
            matrix[size, exponent] = -math.log(self.units.w0) * given[size]
        return matrix

    def columns(self, bare: Floats, values: ArrayLike) -> Floats:
        """Return derivatives by the parameters in SI, shape (n, k), from those in core units."""
        return np.asarray(bare @ np.linalg.inv(self.jacobian(values)), np.float64)

    def covariance(self, bare: Floats, values: ArrayLike) -> Floats:
        """Return the covariance in SI, shape (k, k), from the core's.

        Variances of undetermined parameters, and of those that depend on them, are infinite.
        """
        slopes = self.jacobian(values)
        known = np.where(np.isfinite(bare), bare, 0.0)
        covariance = slopes @ known @ slopes.T
        unseen = ~np.isfinite(np.diag(bare))
        through = (slopes[:, unseen] != 0).any(axis=1)
        covariance[through, through] = np.inf
        return np.asarray(covariance, np.float64)

    @property
    def mixed(self) -> tuple[int, ...]:
        """Indices of sizes whose unit depends on a free exponent."""
        return tuple(self._exponents)

    @property
    def _exponents(self) -> dict[int, int]:
        """Index of the exponent for each size whose unit depends on a free exponent."""
        places = {name: k for k, name in enumerate(self.names)}
        return {k: places[q.less] for k, q in enumerate(self.quantities) if q.less is not None}

    def powers(self, values: ArrayLike) -> Floats:
        """Return the power of 1/s in each parameter's unit."""
        powers = np.array([q.power for q in self.quantities], np.float64)
        for size, exponent in self._exponents.items():
            powers[size] -= np.asarray(values, np.float64)[exponent]
        return powers

    def _scales(self, values: ArrayLike) -> Floats:
        """Return the SI value of each parameter's unit in the core."""
        units = np.array([q.unit for q in self.quantities], np.float64)
        return np.asarray(units * self.units.w0 ** self.powers(values), np.float64)


def widened(value: float, ends: tuple[float, float], further: float) -> tuple[float, float]:
    """Return the ends of a 95 % interval with a further standard error."""
    low, high = (math.hypot(end - value, Z95 * further) for end in ends)
    return (value - low, value + high) if further else ends


def interval(value: float, half: float, *, mixed: bool) -> tuple[float, float]:
    """Return the ends of ``value +- half``; NaN if ``half`` is not finite.

    For a size whose unit is free (``mixed``) the ends are in equal ratios: records determine ``q
    v^n`` at their velocities ``v``, so ``ln q`` and ``n`` are jointly nearly normal.
    """
    if not math.isfinite(half):
        return math.nan, math.nan
    if not mixed or value == 0:
        return value - half, value + half
    ratio = min(half / abs(value), 300.0)  # avoids overflow
    low, high = sorted((value * math.exp(-ratio), value * math.exp(ratio)))
    return low, high
