"""Fitting a pendulum to records by multiple shooting; the work is done in Rust (``src/fit``)."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap import checks
from pendmap.errors import InputError
from pendmap.identification.result import Estimate
from pendmap.model.effects import definition
from pendmap.model.rig import COUNTERPARTS, Rig
from pendmap.model.units import Units

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from pendmap.model.effects import Effect

__all__ = ["FitRun", "Pivot", "TrajectoryFit", "fit_runs", "score"]

LEVEL: Final = 3.841458820694124
"""The 95 % point of chi-squared with one degree of freedom."""
FORCED_WINDOW_SWINGS: Final = 3.0
"""The longest window of a forced run, in periods of small swings: forced motions may be chaotic,
and what is not known of a state grows in them."""
OWN: Final = tuple(COUNTERPARTS)[:-1]
"""The kernel's own parameters, in its order."""
PER_RUN: Final = ("p", "Omega", "phi")
"""What belongs to the drive of one run."""
EXACTNESS: Final = 1e-6
"""The integrator's error allowed to a step, over the smallest standard error of a reading."""
TOLERANCES: Final = (1e-13, 1e-8)
"""Its least and its greatest value."""


@dataclasses.dataclass(frozen=True)
class Pivot:
    """A recorded motion of the pivot.

    Parameters
    ----------
    time : ndarray of float, shape (n,)
        In s, on the clock of the run; each after the one before it.
    vertical, horizontal : ndarray of float, shape (n,), or None
        Upward, and toward positive theta: accelerations in m/s^2, velocities in m/s or positions
        in m.
    quantity : str
        Which of them: ``acceleration``, ``velocity`` or ``position``.
    """

    time: NDArray[np.float64]
    vertical: NDArray[np.float64] | None = None
    horizontal: NDArray[np.float64] | None = None
    quantity: str = "acceleration"


@dataclasses.dataclass(frozen=True)
class FitRun:
    """A record to be fitted.

    Parameters
    ----------
    time : ndarray of float, shape (n,)
        In s; each after the one before it. The drive's phase counts from ``time = 0``.
    theta : ndarray of float, shape (n,)
        What the sensor read, rad, unwrapped.
    sigma : float or ndarray of float, shape (n,)
        Standard error of the readings, rad; above 0.
    trusted : ndarray of bool, shape (n,), or None
        Which samples count; all if none.
    drive : mapping of str to float or None
        ``p``, ``Omega`` (rad/s) and ``phi`` (rad; None or left out: not known) of a harmonic drive.
    pivot : Pivot or None
        A recorded motion of the pivot instead.
    lab_time_s : float
        Time in the laboratory at ``time = 0``, for effects that drift.
    longest_s : float or None
        The longest window; none: the whole record for a free decay, three swings for a forced run.
    name : str
        What to call it.
    """

    time: NDArray[np.float64]
    theta: NDArray[np.float64]
    sigma: float | NDArray[np.float64]
    trusted: NDArray[np.bool_] | None = None
    drive: Mapping[str, float | None] | None = None
    pivot: Pivot | None = None
    lab_time_s: float = 0.0
    longest_s: float | None = None
    name: str = ""

    @property
    def forced(self) -> bool:
        """Whether its pivot moves."""
        return self.drive is not None or self.pivot is not None


@dataclasses.dataclass(frozen=True)
class TrajectoryFit:
    """A pendulum fitted to records.

    Parameters
    ----------
    estimates : mapping of str to Estimate
        Of the free parameters, in SI; standard errors from the covariance, intervals from the
        profile of the likelihood. A name with ``[k]`` belongs to run ``k`` alone.
    names : tuple of str
        The free parameters, in the order of the covariance.
    covariance : ndarray of float, shape (k, k)
        In SI.
    chi2 : float
        The sum of the squared residuals over the standard errors.
    samples, degrees : int
        How many samples count; the same less what was adapted to them.
    rms : float
        Of the residuals, rad, over the samples that count.
    model : Rig
        The model that was given, with the values found; a negative damping is set to 0, which no
        pendulum has: ``estimates`` have it.
    curves : tuple of ndarray of float, shape (2, n)
        For each run angle and velocity (rad, rad/s) of the model at each sample; no numbers where
        there was no window.
    residuals : tuple of ndarray of float, shape (n,)
        For each run what the sensor read less the model's reading, rad; 0 where a sample does not
        count.
    windows : tuple of (int, int, int, float, float)
        Run, first sample, one after the last, angle (rad) and velocity (rad/s) at its first sample.
    steps : int
        Steps of the search.
    converged : bool
        Whether it ended.
    widening : float
        Above 1 where the sum of squares is greater than chance allows, as it is where the model
        lacks something: the intervals are wider by its root, covariance and standard errors are
        not.
    """

    estimates: Mapping[str, Estimate]
    names: tuple[str, ...]
    covariance: NDArray[np.float64]
    chi2: float
    samples: int
    degrees: int
    rms: float
    model: Rig
    curves: tuple[NDArray[np.float64], ...]
    residuals: tuple[NDArray[np.float64], ...]
    windows: tuple[tuple[int, int, int, float, float], ...]
    steps: int
    converged: bool
    widening: float

    def __getitem__(self, name: str) -> float:
        """Return the value of one estimate."""
        return self.estimates[name].value


@dataclasses.dataclass(frozen=True)
class _Quantity:
    """A free parameter: its name in SI, the power of ``w0`` that it has, where it stands."""

    name: str
    power: float
    places: list[tuple[int, int]]
    start: float

    @property
    def is_w0(self) -> bool:
        return self.name == "w0"

    def bare(self, value: float, units: Units) -> float:
        """Return what the core calls it: of ``w0`` gravity."""
        return (value / units.w0) ** 2 if self.is_w0 else float(units.bare(value, self.power))

    def given(self, value: float, units: Units) -> float:
        if self.is_w0:
            return units.w0 * math.sqrt(value) if value > 0 else math.nan
        return float(units.given(value, self.power))

    def slope(self, value: float, units: Units) -> float:
        """Return the derivative of :meth:`given`."""
        if self.is_w0:
            return 0.5 * units.w0 / math.sqrt(value)
        return float(units.given(1.0, self.power))


def fit_runs(  # noqa: PLR0913 (the records, and what is known of them)
    runs: Sequence[FitRun],
    model: Rig,
    free: Sequence[str] = ("w0", "c_over_m", "Tr"),
    *,
    start: Mapping[str, float] | None = None,
    profiled: Sequence[str] | None = None,
    shortest_s: float | None = None,
    windows: Sequence[tuple[int, int, int, float, float]] | None = None,
    sigma_doubt: float = 0.0,
) -> TrajectoryFit:
    """Return the pendulum that fits records best, by weighted least squares.

    The sum over all samples of ``((reading - model) / sigma)**2`` is least over the free
    parameters and over an initial state for each window. Windows begin with about one swing and
    grow fourfold from stage to stage, to the whole record of a free decay.

    Parameters
    ----------
    runs : sequence of FitRun
        The records.
    model : Rig
        What is known, and where the search starts; its ``w0`` may be off by some percent. Effects
        of the drive are left out of runs without one.
    free : sequence of str
        What is fitted: names of :class:`pendmap.Rig`, and ``effect.parameter`` of effects of the
        model. ``p``, ``Omega`` and ``phi`` are those of each run with a drive; a ``phi`` that a run
        does not know is fitted anyhow.
    start : mapping of str to float, optional
        Other starts for some; here damping may be negative.
    profiled : sequence of str, optional
        For which an interval is computed from the profile; all if none are given.
    shortest_s : float, optional
        Length of the first windows, s; one swing if none is given.
    windows : sequence, optional
        Those of a former fit: the search begins with them, without stages.
    sigma_doubt : float
        Relative standard error of ``sigma``.

    Raises
    ------
    InputError
        If a name is not known, a record is too short or not finite, or the start leads out of the
        range of numbers.

    References
    ----------
    Bock (1983), Progress in Scientific Computing 2, 95; Venzon & Moolgavkar (1988), Applied
    Statistics 37, 87.
    """
    from pendmap import _core  # noqa: PLC0415 (the core is loaded where it works)

    units = Units(model.w0, si=True)
    quantities, given = _prepare(runs, model, free, start or {}, units)
    wanted = [q.name for q in quantities] if profiled is None else list(profiled)
    chosen = [k for k, q in enumerate(quantities) if {q.name, q.name.partition("[")[0]} & {*wanted}]
    swing = math.tau / model.w0
    choices = {
        "tolerance": _tolerance(runs),
        "shortest": units.w0 * (swing if shortest_s is None else shortest_s),
        "growth": 4.0,
        "steps": 40,
        "gain": 1e-3,
        "profiled": chosen,
        "level": LEVEL,
        "doubt": sigma_doubt,
    }
    bare = [(q.places, q.bare(q.start, units)) for q in quantities]
    try:
        found = _core.fit_runs(
            given, bare, choices, None if windows is None else _bare_windows(windows, units)
        )
    except ValueError as error:
        raise InputError(str(error)) from None
    return _result(found, runs, model, quantities, chosen, units)


def score(
    fit: TrajectoryFit, runs: Sequence[FitRun], candidates: Sequence[str], model: Rig
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what candidate parameters would gain, without fitting them (the score test).

    Parameters
    ----------
    fit : TrajectoryFit
        The fit without them.
    runs : sequence of FitRun
        Its records.
    candidates : sequence of str
        Names of further parameters, as in ``free`` of :func:`fit_runs`.
    model : Rig
        The model of the fit with the candidates' effects in it, at the values where they are
        scored: 0 for their size.

    Returns
    -------
    pull : ndarray of float, shape (k,)
        Half of the slope of the sum of squares by each candidate, the fitted parameters and states
        following.
    information : ndarray of float, shape (k, k)
        Half of its curvature. ``pull[i]**2 / information[i, i]`` is the gain in the sum of squares
        that candidate ``i`` alone is expected to bring, ``pull[i] / information[i, i]`` its size in
        SI; sets of candidates likewise, by the parts of both.
    """
    from pendmap import _core  # noqa: PLC0415 (the core is loaded where it works)

    units = Units(model.w0, si=True)
    base = list(dict.fromkeys(name.partition("[")[0] for name in fit.names))
    start = {name: fit.estimates[name].value for name in fit.names}
    quantities, given = _prepare(runs, model, [*base, *candidates], start, units)
    bare = [(q.places, q.bare(q.start, units)) for q in quantities]
    try:
        windows = _bare_windows(fit.windows, units)
        at = _core.fit_equations(given, bare, _tolerance(runs), windows)
    except ValueError as error:
        raise InputError(str(error)) from None
    slopes = np.array([q.slope(b, units) for q, (_, b) in zip(quantities, bare, strict=True)])
    pull = at["pull"] / slopes
    information = at["information"] / np.outer(slopes, slopes)
    new = np.array([q.name not in fit.estimates for q in quantities])
    old = ~new
    through = information[np.ix_(new, old)] @ np.linalg.pinv(
        information[np.ix_(old, old)], hermitian=True
    )
    return (
        pull[new] - through @ pull[old],
        information[np.ix_(new, new)] - through @ information[np.ix_(old, new)],
    )


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


def _prepare(
    runs: Sequence[FitRun],
    model: Rig,
    free: Sequence[str],
    start: Mapping[str, float],
    units: Units,
) -> tuple[list[_Quantity], list[dict[str, Any]]]:
    """Return the free parameters and the runs as the core takes them."""
    if not runs:
        raise InputError("runs is empty: allowed is one record or more")
    rigs = [_rig_of(run, model) for run in runs]
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
            places = [(k, place) for k in where if (place := _place(name, rigs[k])) is not None]
            if not places:
                raise InputError(f"free has {checks.shown(name)}: allowed are {known}")
            quantities.append(
                _Quantity(own, _power(name, rigs[places[0][0]], names), places, math.nan)
            )
    if "phi" not in names:
        quantities += [
            _Quantity(f"phi[{k}]" if len(runs) > 1 else "phi", 0, [(k, PLACES["phi"])], math.nan)
            for k in unknown_phase
        ]
    quantities = [
        dataclasses.replace(
            q, start=start.get(q.name, start.get(q.name.partition("[")[0], _value(q, rigs)))
        )
        for q in quantities
    ]
    return quantities, [_bare_run(run, rig, units) for run, rig in zip(runs, rigs, strict=True)]


def _rig_of(run: FitRun, model: Rig) -> Rig:
    drive = {"p": 0.0, "Omega": 0.0, "phi": 0.0}
    if run.drive is not None:
        drive |= {name: value or 0.0 for name, value in run.drive.items()}
    effects = model.effects if run.drive else tuple(e for e in model.effects if not e.drives)
    return dataclasses.replace(model, **drive, effects=effects, lab_time_s=run.lab_time_s, notes={})


def _effect(name: str, rig: Rig) -> tuple[int, Effect, str] | None:
    """Return an effect's first place, the effect and the parameter, by ``effect.parameter``."""
    place = len(OWN)
    effect_name, _, parameter = name.rpartition(".")
    for effect in rig.effects:
        if effect.name == effect_name and parameter in effect.parameters:
            return place, effect, parameter
        place += len(effect.parameters)
    return None


def _place(name: str, rig: Rig) -> int | None:
    if name in PLACES:
        return PLACES[name]
    found = _effect(name, rig)
    return None if found is None else found[0] + list(found[1].parameters).index(found[2])


def _power(name: str, rig: Rig, free: Sequence[str]) -> float:
    if name == "w0":
        return 1
    own = dict(COUNTERPARTS.values())
    if name in own:
        return own[name]
    found = _effect(name, rig)
    if found is None:
        raise InputError(f"free has {checks.shown(name)}: the model has no such effect")
    _, effect, parameter = found
    entry = next(e for e in definition(effect.name)["parameters"] if e["name"] == parameter)
    less = entry["power_of_w0_less"]
    if less is None:
        return float(entry["power_of_w0"])
    if f"{effect.name}.{less}" in free:
        raise InputError(
            f"free has {effect.name}.{less} beside {name}, whose unit depends on it: allowed is "
            "one of them"
        )
    return float(entry["power_of_w0"] - effect.parameters[less])


def _value(quantity: _Quantity, rigs: Sequence[Rig]) -> float:
    rig = rigs[quantity.places[0][0]]
    name = quantity.name.partition("[")[0]
    if name in PLACES:
        return float(getattr(rig, name))
    found = _effect(name, rig)
    return math.nan if found is None else found[1].parameters[found[2]]


def _bare_run(run: FitRun, rig: Rig, units: Units) -> dict[str, Any]:
    time = _floats("time", run.time)
    theta = _floats("theta", run.theta)
    sigma = np.broadcast_to(np.asarray(run.sigma, dtype=np.float64), time.shape)
    if not (np.all(np.isfinite(sigma)) and np.all(sigma > 0)):
        raise InputError("sigma is not above 0 everywhere: allowed are finite numbers above 0")
    weight = 1.0 / sigma
    if run.trusted is not None:
        weight = np.where(np.asarray(run.trusted, dtype=bool), weight, 0.0)
    longest = run.longest_s
    if longest is None:
        longest = FORCED_WINDOW_SWINGS * math.tau / rig.w0 if run.forced else math.inf
    return {
        "parameters": rig.pendulum.parameters,
        "time": units.bare(time, -1),
        "reading": theta,
        "weight": np.ascontiguousarray(weight),
        "longest": float(units.bare(longest, -1)),
        "pivot": None if run.pivot is None else _bare_pivot(run.pivot, rig, units),
    }


def _bare_pivot(pivot: Pivot, rig: Rig, units: Units) -> dict[str, Any]:
    # Lengths in g / w0^2: then accelerations are over gravity.
    powers = {"acceleration": 0, "velocity": 1, "position": 2}
    if pivot.quantity not in powers:
        raise InputError(
            f"quantity is {checks.shown(pivot.quantity)}: allowed are {', '.join(powers)}"
        )
    factor = units.w0 ** powers[pivot.quantity] / rig.gravity

    def bare(values: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        return None if values is None else factor * _floats("pivot", values)

    return {
        "quantity": pivot.quantity,
        "time": units.bare(_floats("pivot time", pivot.time), -1),
        "vertical": bare(pivot.vertical),
        "horizontal": bare(pivot.horizontal),
    }


def _floats(what: str, values: object) -> NDArray[np.float64]:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.ndim != 1:
        raise InputError(f"{what} has {array.ndim} dimensions: allowed is 1")
    return array


def _bare_windows(
    windows: Sequence[tuple[int, int, int, float, float]], units: Units
) -> list[tuple[int, int, int, float, float]]:
    return [(r, a, b, theta, units.bare(v, 1)) for r, a, b, theta, v in windows]


def _tolerance(runs: Sequence[FitRun]) -> float:
    smallest = min(float(np.min(run.sigma)) for run in runs)
    return float(np.clip(EXACTNESS * smallest, *TOLERANCES))


def _result(  # noqa: PLR0913, PLR0917 (all that the fit had, and what came of it)
    found: Mapping[str, Any],
    runs: Sequence[FitRun],
    model: Rig,
    quantities: Sequence[_Quantity],
    chosen: Sequence[int],
    units: Units,
) -> TrajectoryFit:
    values = found["values"]
    slopes = np.array([q.slope(v, units) for q, v in zip(quantities, values, strict=True)])
    with np.errstate(invalid="ignore"):
        covariance = found["covariance"] * np.outer(slopes, slopes)
    ends = dict(zip(chosen, found["intervals"], strict=True))
    estimates = {}
    for k, (q, value) in enumerate(zip(quantities, values, strict=True)):
        interval = ends.get(k)
        low, high = (q.given(e, units) for e in interval) if interval else (math.nan, math.nan)
        estimates[q.name] = Estimate(
            q.given(value, units),
            math.sqrt(covariance[k, k]),
            (low, high) if math.isfinite(low) and math.isfinite(high) else None,
        )
    curves, residuals, squares = [], [], 0.0
    for run, curve in zip(runs, found["runs"], strict=True):
        curves.append(np.stack([curve["theta"], units.given(curve["velocity"], 1)]))
        residuals.append(curve["residual"] * run.sigma)
        squares += float(np.nansum(residuals[-1] ** 2))
    return TrajectoryFit(
        estimates=estimates,
        names=tuple(estimates),
        covariance=covariance,
        chi2=found["chi2"],
        samples=found["samples"],
        degrees=found["degrees"],
        rms=math.sqrt(squares / max(found["samples"], 1)),
        model=_found_model(model, estimates),
        curves=tuple(curves),
        residuals=tuple(residuals),
        windows=tuple(
            (r, a, b, theta, float(units.given(v, 1))) for r, a, b, theta, v in found["windows"]
        ),
        steps=found["steps"],
        converged=found["converged"],
        widening=found["widening"],
    )


def _found_model(model: Rig, estimates: Mapping[str, Estimate]) -> Rig:
    own = {n: e.value for n, e in estimates.items() if n in PLACES}
    own |= {n: max(own[n], 0.0) for n in ("c_over_m", "Tr") if n in own}
    if model.p == 0:
        own = {n: value for n, value in own.items() if n not in PER_RUN}
    effects = []
    for effect in model.effects:
        names = {p: f"{effect.name}.{p}" for p in effect.parameters}
        known = {p: estimates[n].value for p, n in names.items() if n in estimates}
        bounds = {p: estimates[n].ci95 for p, n in names.items() if n in estimates}
        ci95 = {p: ci for p, ci in bounds.items() if ci is not None}
        parameters = dict(effect.parameters) | known
        effects.append(dataclasses.replace(effect, parameters=parameters, ci95=ci95))
    return dataclasses.replace(model, **own, effects=tuple(effects), notes={})
