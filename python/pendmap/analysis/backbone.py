"""The backbone: motions without losses and drive, by their energy."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr
from numpy.polynomial import legendre
from scipy.optimize import brentq

from pendmap import _core
from pendmap.analysis import result
from pendmap.analysis.result import Field, Schema
from pendmap.analysis.run import Numerics
from pendmap.errors import InputError, check_number, check_whole, core_errors
from pendmap.files.variables import variable
from pendmap.model import without_dimensions
from pendmap.units import TIME, VELOCITY

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats

_NODES: Final = legendre.leggauss(32)  # Nodes and weights of a work integral, within half a turn
_POINTS: Final = 512  # Nodes of the trapezoidal rule for a period, which converges exponentially
_TURN: Final = 4096  # The same for a whole turn, near a separatrix with a sharp peak
_PLACES: Final = 720  # Angles at which rests are sought
_NONE: Final = 1e-12  # A force up to which it is none


def _families(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the families for the JSON object."""
    names = ("energy", "amplitude", "period", "rate", "velocity")
    table = {name: dataset[f"motion_{name}"].values for name in names}
    kinds, rests = dataset["family_kind"].values, dataset["family_theta"].values
    families = []
    for number, (kind, theta) in enumerate(zip(kinds, rests.tolist(), strict=True)):
        mine = dataset["motion_family"].values == number
        columns = {name: x[mine].tolist() for name, x in table.items()}
        if kind == "rotation":
            columns["amplitude"] = [None] * len(columns["energy"])
        families.append({"kind": str(kind), "theta": theta, **columns})
    return families


SCHEMA = Schema(
    "backbone",
    result.UNITS,
    Field("families", "", "motions of each kind, by energy", read=_families),
    Field("energy_max", "1", "largest energy of rotations over m g l"),
    Field("count", "", "motions of a family"),
    *result.END,
    *result.VERSIONS,
    references="Landau & Lifshitz (1976), Mechanics, section 11",
)


def backbone(pendulum: Pendulum | Rig, *, energy_max: float = 6.0, count: int = 100) -> xr.Dataset:
    """Return the motions of a pendulum without losses and drive, by their energy.

    Damping, friction and drive of the model are left out, and of effects all that is odd in the
    velocity; what stays must be forces of the angle alone. A motion of energy ``E`` over that of
    rest has the period

    ``T = 2 int dth / sqrt(2 (E - V(th)))`` from one turn to the other,

    without effects and torque ``4 K(sin^2(A/2))``, ``A`` the amplitude; a rotation the time of one
    turn. Weakly damped and driven orbits ``n:w`` lie near motions whose rate ``2 pi/T`` is ``omega
    k/n``, ``k`` their oscillations, or turns, in ``n`` periods: the backbone of a resonance curve.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model.
    energy_max : float
        Largest energy of rotations, over ``m g l`` and from rest on.
    count : int
        Number of motions of each family; energies grow as squares of equal steps.

    Returns
    -------
    xarray.Dataset
        Families over ``family``: ``family_kind`` (oscillation or rotation), ``family_theta`` (its
        rest). Motions over ``motion``: ``motion_family``, ``motion_energy`` (over ``m g l``),
        ``motion_amplitude`` (half the angle between turns; nan of a rotation), ``motion_period``,
        ``motion_rate`` (``2 pi/T``), ``motion_velocity`` (the greatest).

    Raises
    ------
    InputError
        If an effect depends on time or in an even way on the velocity, or counts turns.

    References
    ----------
    Landau & Lifshitz (1976), Mechanics, section 11.

    Examples
    --------
    >>> import pendmap
    >>> result = pendmap.backbone(pendmap.Pendulum(), count=3)
    >>> result.motion_amplitude.values[:2].round(4), result.motion_period.values[:2].round(4)
    (array([0.5054, 1.0472]), array([6.385, 6.743]))
    """
    bare, units = without_dimensions(pendulum)
    energy_max = check_number("energy_max", energy_max)
    count = check_whole("count", count, 2, 10_000)
    force = _Force(bare)
    parts = (np.arange(1, count + 1) / (count + 1)) ** 2
    kinds, rests, rows = [], [], []
    for rest, saddles in force.wells():
        level = min(force.work(rest, saddle) for saddle in saddles)
        kinds.append("oscillation")
        rests.append(rest)
        rows.append([force.oscillation(rest, saddles, level * part) for part in parts])
    if rows and not force.torque:
        low = min(rests, key=lambda rest: float(force.work(0.0, rest)))
        top = max(float(force.work(low, x)) for _, saddles in force.wells() for x in saddles)
        if energy_max <= top:
            raise InputError(
                f"energy_max must be above {top:.6g}, the least of a rotation, got {energy_max:g}"
            )
        kinds.append("rotation")
        rests.append(low)
        rows.append([force.rotation(low, top + (energy_max - top) * part) for part in parts])
    if not rows:
        raise InputError("torque: the pendulum has no rest, so there is no motion that closes")
    every = np.array(rows)
    family = np.repeat(np.arange(len(rows), dtype=np.int32), count)
    energy, amplitude, period, velocity = every.reshape(-1, 4).T
    period = units.given(period, TIME)
    rate = 2 * math.pi / period
    dataset = xr.Dataset(
        {
            "family_kind": variable("family", np.array(kinds), long_name="kind of motion"),
            "family_theta": variable("family", np.array(rests), "rad", "rest"),
            "motion_family": variable("motion", family, "1", "number of the family"),
            "motion_energy": variable("motion", energy, "1", "energy over m g l"),
            "motion_amplitude": variable("motion", amplitude, "rad", "half the angle of a swing"),
            "motion_period": variable("motion", period, units.of_time, "period"),
            "motion_rate": variable("motion", rate, units.of_velocity, "2 pi over the period"),
            "motion_velocity": variable(
                "motion", units.given(velocity, VELOCITY), units.of_velocity, "greatest velocity"
            ),
        }
    )
    values = Numerics().provenance() | {"energy_max": energy_max, "count": count}
    SCHEMA.complete(dataset, pendulum, values)
    result.summarised(dataset, _summary(dataset), pendulum, "motions are")
    return dataset


def along(pendulum: Pendulum | Rig, name: str) -> dict[str, Any]:
    """Return amplitudes of free swings about hanging rest over their rate, as omega or Hz."""
    try:
        free = backbone(pendulum)
    except InputError:
        return {}
    number = int(np.argmin(np.abs(free["family_theta"].values)))
    mine = free["motion_family"].values == number
    rate, (_, units) = free["motion_rate"].values[mine], without_dimensions(pendulum)
    rate = rate / (2 * math.pi) if name == "frequency_hz" else units.bare(rate, VELOCITY)
    amplitude, unit = free["motion_amplitude"][mine], "Hz" if name == "frequency_hz" else "1"
    return {
        "backbone_value": variable("motion", rate, unit, "rate of free swings"),
        "backbone_amplitude": variable("motion", amplitude.values, "rad", "their amplitude"),
    }


def _summary(dataset: xr.Dataset) -> list[str]:
    lines = []
    for number, kind in enumerate(dataset["family_kind"].values):
        mine = dataset["motion_family"].values == number
        rate = dataset["motion_rate"].values[mine]
        unit = dataset["motion_rate"].attrs["units"]
        ends = f"{rate[0]:.6g} to {rate[-1]:.6g}" + ("" if unit == "1" else f" {unit}")
        lines.append(f"{kind}: rates {ends}, from the lowest to the highest energy.")
    return lines


class _Force:
    """The force of the angle, without losses and drive."""

    def __init__(self, model: Pendulum) -> None:
        self.still = dataclasses.replace(model, gamma=0.0, p=0.0, theta_r=0.0)
        if model.counts_turns:
            raise InputError("effects: an effect counts turns: its motions do not close")
        self.angles = 2 * math.pi * (np.arange(_PLACES) + 0.5) / _PLACES - math.pi
        with core_errors():
            forces = self.at(self.angles)
            even = [
                0.5 * (self.at(self.angles, 0, v) + self.at(self.angles, 0, -v)) for v in (1, 2)
            ]
        if any(np.abs(x - forces).max() > _NONE for x in [*even, self.at(self.angles, 1.1)]):
            raise InputError(
                "effects must be losses, odd in the velocity, or forces of the angle alone for a "
                "backbone, got one that is neither"
            )
        mean = float(forces.mean())
        self.torque = mean if abs(mean) > _NONE else 0.0

    def at(self, theta: Floats, tau: float = 0.0, velocity: float = 0.0) -> Floats:
        """Return the acceleration at angles."""
        shape, flat = np.shape(theta), np.ravel(theta)
        full = np.full_like
        forces = _core.acceleration(self.still, full(flat, tau), flat, full(flat, velocity))
        return np.reshape(forces, shape)

    def work(self, start: Any, end: Any) -> Any:  # noqa: ANN401 (numbers or arrays)
        """Return the energy that the force takes from one angle to another, by Gauss's rule."""
        start, end = np.asarray(start, float), np.asarray(end, float)
        nodes, weights = _NODES
        half = 0.5 * (end - start)
        theta = 0.5 * (start + end)[..., None] + half[..., None] * nodes
        return -half * (self.at(theta) @ weights)

    def wells(self) -> Iterator[tuple[float, tuple[float, float]]]:
        """Yield each stable rest within a turn and the unstable ones on both sides of it."""
        theta = 2 * math.pi * (np.arange(2 * _PLACES + 1) + 0.5) / _PLACES - 2 * math.pi
        force = self.at(theta)
        falls = np.flatnonzero((force[:-1] > 0) & (force[1:] <= 0))
        rises = np.flatnonzero((force[:-1] < 0) & (force[1:] >= 0))
        for k in falls:
            rest = self.zero(theta[k], theta[k + 1])
            if -math.pi < rest <= math.pi:
                j, m = rises[rises < k][-1], rises[rises > k][0]
                yield rest, (self.zero(theta[j], theta[j + 1]), self.zero(theta[m], theta[m + 1]))

    def zero(self, low: float, high: float) -> float:
        """Return the angle at which the force passes 0."""
        return float(brentq(lambda x: float(self.at(np.array(x))), low, high, xtol=1e-15))

    def oscillation(self, rest: float, saddles: tuple[float, float], energy: float) -> list[float]:
        """Return energy, amplitude, period and greatest velocity of a motion about a rest."""
        turns = [
            float(brentq(lambda x: float(self.work(rest, x)) - energy, rest, saddle, xtol=1e-15))
            for saddle in saddles
        ]
        middle, half = 0.5 * sum(turns), 0.5 * (turns[1] - turns[0])
        # th = middle + half sin(phi): the integrand is smooth and periodic in phi.
        phi = math.pi * ((np.arange(_POINTS) + 0.5) / _POINTS - 0.5)
        theta = middle + half * np.sin(phi)
        left = np.where(phi < 0, self.work(theta, turns[0]), self.work(theta, turns[1]))
        period = 2 * math.pi / _POINTS * float((half * np.cos(phi) / np.sqrt(2 * left)).sum())
        return [energy, half, period, math.sqrt(2 * energy)]

    def rotation(self, rest: float, energy: float) -> list[float]:
        """Return energy, no amplitude, period and greatest velocity of a rotation."""
        theta = rest + 2 * math.pi * np.arange(_TURN) / _TURN
        speed = np.sqrt(2 * (energy - self.work(rest, theta)))
        return [energy, math.nan, 2 * math.pi * float((1 / speed).mean()), float(speed.max())]
