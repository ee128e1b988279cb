"""Trajectories: one start, or several with common times."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import result
from pendmap.analysis.grid import ascending, starts
from pendmap.analysis.numerics import Numerics
from pendmap.analysis.result import Field, Found, Schema, summarised
from pendmap.analysis.trajectories import alike, rows_of, several_facts, several_lines
from pendmap.errors import (
    MOST_SAMPLES,
    InputError,
    check_callable,
    check_flag,
    check_number,
    check_whole,
    core_errors,
    short_repr,
)
from pendmap.files import facts
from pendmap.files.variables import variable
from pendmap.formatting import counted, with_error
from pendmap.model import without_dimensions
from pendmap.units import RATE, TIME, VELOCITY, Units

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats, Indices

    Live = Callable[[Floats, Floats, Floats], object]


_SAMPLES = 64  # Default number of samples a period
_APART = 0.1  # Angle between two samples that looks smooth in the phase plane, rad
_SMOOTH_SAMPLES = 200_000
"""Total number of samples up to which a trajectory has more than ``_SAMPLES`` a period."""
_MOST_SAMPLES = 2_000_000
"""Total number of samples above which a trajectory has fewer than ``_SAMPLES`` a period."""
_STRONGEST = 1e6  # Acceleration of the pivot over gravity up to which a trajectory takes seconds
_ALIGNMENT, _BATCHES = 0.1, 20
"""Fraction of a trajectory before the exponent is measured, number of batches; as in the core."""
FORMULA = "(dtheta/dtau)^2 / 2 + 1 - cos(theta), over m g l"
"""Formula of the energy, a comment in datasets."""


def _last(name: str) -> Callable[[xr.Dataset], float]:
    """Return a function that reads the last value of a variable."""
    return lambda dataset: float(dataset[name].values[-1])


SCHEMA = Schema(
    "trajectory",
    result.UNITS,
    Field("t", result.OF_TIME, "last time", read=lambda dataset: dataset.attrs["until"]),
    Field("theta", "rad", "angle at the end, not wrapped", read=_last("theta")),
    Field("velocity", result.OF_VELOCITY, "velocity at the end", read=_last("velocity")),
    Found("stuck", result.FLAG, "whether friction holds the pendulum at the end", convert=bool),
    Found("turns", "1", "full turns between start and end"),
    result.TOL,
    Field(
        "tol_reached",
        "",
        "whether the tolerance was reached",
        read=lambda dataset: bool(dataset["reached_error"] <= dataset.attrs["tol"]),
    ),
    result.REACHED,
    Found("end_error", "1", "change of the end by a 16 times smaller error of each step"),
    Field(
        "interrupted",
        "",
        "1 where Ctrl-C ended it",
        read=lambda dataset: bool(dataset.attrs.get("interrupted", 0)),
    ),
    Field("energy", "m g l", "energy at the end", read=_last("energy")),
    result.SIMD,
    Found("exponent", result.OF_RATE, "Lyapunov exponent of this stretch", None, when="lyapunov"),
    Field(
        "stderr",
        result.OF_RATE,
        "its standard error",
        read=lambda dataset: facts(dataset).get("exponent_stderr"),
        when="lyapunov",
    ),
    Found("exponent_from", result.OF_TIME, "when its measurement begins", None, when="lyapunov"),
    Found("exponent_to", result.OF_TIME, "when its measurement ends", None, when="lyapunov"),
    result.MISSES,
    result.SUMMARY.hidden,
    Found("exponent_stderr", result.OF_RATE, "standard error of the exponent", None, json=False),
    Field("until", result.OF_TIME, "last time", json=False),
    Field("until_asked", result.OF_TIME, "last time that was asked for", None, json=False),
    Field("theta0", "rad", "angle at the start", json=False),
    Field("velocity0", result.OF_VELOCITY, "velocity at the start", json=False),
    result.STEPS.hidden,
    Field("lyapunov", "", "1 where an exponent was asked for", json=False),
    *result.VERSIONS,
)


def simulate(  # noqa: PLR0913 (physics first, numerical choices by name)
    pendulum: Pendulum | Rig,
    theta: ArrayLike,
    velocity: ArrayLike,
    until: float | None = None,
    *,
    t_eval: ArrayLike | None = None,
    tol: float = 1e-9,
    samples: int | None = None,
    lyapunov: bool = False,
    live: Live | None = None,
) -> xr.Dataset:
    """Integrate trajectories: time history, stroboscopic (Poincare) section and energy.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; as for :func:`pendmap.basins`.
    theta, velocity : float or array_like, shape (N,)
        State at ``tau = 0``: angle in rad, velocity ``d theta / d tau``. With an array there are N
        trajectories, sampled at common times; a number beside it is that of all.
    until : float, optional
        Last time, in units of ``1 / w0``; above 0. By default the last of ``t_eval``.
    t_eval : array_like, shape (M,), optional
        Times of the samples, ascending, from 0 up to ``until``; the trajectory ends with the last.
        States are those of the integrator's dense output, as exact as its steps.
    tol : float
        Error of the state after 5 periods, or at the end if that is sooner; 1e-13 to 1e-2. The
        error of each step is tightened until a 16 times smaller one changes that state by no more,
        or until rounding forbids more, which the summary reports. ``reached_error`` is the error
        reached, ``end_error`` the difference at the end.
    samples : int, optional
        Samples a period; by default 64 or more. Without ``lyapunov`` a quick motion has as many as
        a smooth curve needs, up to 200,000 in all; fewer than 64 where that would be more than two
        million.
        The motion does not depend on them, the batches of an exponent do.
    lyapunov : bool
        Whether to compute the largest Lyapunov exponent of this stretch of trajectory. Its standard
        error is that of 20 batches, the first tenth left out (from the time ``exponent_from`` to
        ``exponent_to``). It is the exponent of an attractor only if the
        trajectory was on it all that time: a chaotic transient has a positive one, wherever it
        ends. :func:`pendmap.lyapunov` computes that of the attractor. Sticking may give none.
    live : callable, optional
        Called with times, angles and velocities, three arrays of one length in the units of the
        result, of the samples that are new since the last call: about every 50 ms while it
        integrates, and at the end. Their values are those of the result. With it Ctrl-C ends the
        trajectory with the last sample instead of raising; the attribute ``interrupted`` is 1 then.
        For one trajectory without ``t_eval``.

    Returns
    -------
    xarray.Dataset
        ``theta`` (not wrapped), ``velocity`` and ``energy`` (over m g l, ``v^2 / 2 + 1 - cos
        theta``, 0 at rest) over ``time``; ``section_theta`` (wrapped to (-pi, pi]) and
        ``section_velocity`` over ``period``; ``event_time``, ``event_kind`` (turn,
        stick, release, stuck for ever) and ``event_theta`` over ``event``, located to rounding.
        ``stuck`` is 1 if friction holds the pendulum at the end. With an array of starts all of
        these are over ``start`` too; a trajectory with fewer events than another has nan and no
        kind in their place. ``result.isel(start=0)`` is one trajectory.

    Raises
    ------
    InputError
        If a value is not finite or outside its range.
    MemoryError
        If there is too little memory for the samples.
    KeyboardInterrupt
        After Ctrl-C, without ``live`` or before the first sample.

    Examples
    --------
    >>> import pendmap
    >>> pendulum = pendmap.Pendulum(gamma=0.1, p=0.6, omega=2.0)
    >>> result = pendmap.simulate(pendulum, theta=1.0, velocity=0.0, until=20.0)
    >>> round(float(result.theta[-1]), 3)
    0.446
    >>> pendmap.simulate(pendulum, [0.5, 1.0], 0.0, t_eval=[0.0, 20.0]).theta.values.round(3)
    array([[0.5  , 0.297],
           [1.   , 0.446]])
    """
    bare, units = without_dimensions(pendulum)
    check_callable("live", live, "three arrays, times, angles and velocities")
    numerics = Numerics(tol=tol)
    several = np.ndim(theta) > 0 or np.ndim(velocity) > 0
    angles, speeds = starts(*alike(theta, velocity)) if several else _one(theta, velocity)
    lyapunov = check_flag("lyapunov", lyapunov)
    _refuse_strong(bare)
    until, wanted = _times(until, t_eval)
    given = {"samples": samples is not None, "lyapunov": lyapunov, "live": live is not None}
    _refuse(given, timed=wanted is not None, several=several)
    periods, end = until / pendulum.period, units.bare(until, TIME)
    if samples is None:
        per_start = _MOST_SAMPLES // angles.size
        samples = int(min(_SAMPLES, max(1, per_start // max(periods, 1))))
        if not lyapunov:  # the batches of an exponent depend on the number of samples
            fastest = float(units.bare(np.abs(speeds).max(), VELOCITY))
            samples = max(samples, _smooth(bare, fastest, end) // angles.size)
    samples = check_whole("samples", samples, 1, MOST_SAMPLES)
    number = periods * samples if wanted is None else wanted.size
    if number * angles.size > 100 * _MOST_SAMPLES:
        most = 100 * _MOST_SAMPLES // samples // angles.size * pendulum.period
        raise InputError(
            f"until must be a time up to {most:.3g}, got {until:g}: {periods:.3g} periods do not "
            "fit into memory"
        )
    times, every, once = _sampled(wanted, bare, units)

    def shown(times: Floats, angles: Floats, speeds: Floats) -> None:
        if live is not None:
            live(units.given(times, TIME), angles, units.given(speeds, VELOCITY))

    choices = (numerics.tol, samples, lyapunov, live and shown, times.tolist())
    end = end if wanted is None else float(times[-1])
    with core_errors():
        raws = [
            _core.simulate(bare, start, end, *choices)
            for start in zip(angles.tolist(), units.bare(speeds, VELOCITY).tolist(), strict=True)
        ]
    raw = raws[0]
    if wanted is None:
        every, once = np.arange(raw.time.size), np.arange(0, raw.time.size, samples)
        if raw.time[once[-1]] < (1 - 1e-9) * once[-1] / samples * bare.period:
            once = once[:-1]  # the end, between two samples
    time = units.given(raw.time, TIME)
    clock = time[every] if wanted is None else wanted
    dataset = _dataset(raws, every, once, clock, pendulum, several=several)
    facts_of = [
        {
            **_exponent(path, time, units),
            "turns": math.trunc((float(path.theta[-1]) - angle) / math.tau),
            "stuck": int(path.stuck),
            "reached_error": path.reached_error,
            "end_error": path.end_error,
        }
        for path, angle in zip(raws, angles, strict=True)
    ]
    values = {
        **numerics.provenance(),
        **{name: value for of_start in reversed(facts_of) for name, value in of_start.items()},
        "theta0": None if several else angles.item(),
        "velocity0": None if several else speeds.item(),
        "until": float(time[-1]) if raw.interrupted else until,
        "steps_per_period": max(path.steps_per_period for path in raws),
        "lyapunov": int(lyapunov),
    }
    if raw.interrupted:
        values |= {"interrupted": 1, "until_asked": until}
    SCHEMA.complete(dataset, pendulum, values, raw)
    if several:
        several_facts(dataset, facts_of, angles, speeds, units)
    lines = several_lines(dataset, units) if several else _summary(dataset, units)
    what = "angles and velocities here are" if several else "angle and velocity here are"
    summarised(dataset, lines, pendulum, what)
    return dataset


def _dataset(  # noqa: PLR0913 (samples and where they belong)
    raws: list[_core.Trajectory],
    every: Indices,
    once: Indices,
    clock: Floats,
    pendulum: Pendulum | Rig,
    *,
    several: bool,
) -> xr.Dataset:
    """Return the samples ``every``, at times ``clock``, the section at ``once``, and the events."""
    of, units = rows_of(raws) if several else raws[0], pendulum.units
    theta, speed = of.theta[..., every], units.given(of.velocity, VELOCITY)
    start = ("start",) if several else ()
    wrapped = -np.remainder(math.pi - of.theta[..., once], math.tau) + math.pi
    kinds, rate = np.array(of.event_kind, dtype=str), (units.of_velocity, "velocity, likewise")
    event_time = units.given(of.event_time, TIME)
    fell = energy(theta, speed[..., every], pendulum.attributes)
    at, period, event = (*start, "time"), (*start, "period"), (*start, "event")
    return xr.Dataset(
        {
            "theta": variable(at, theta, "rad", "angle, not wrapped"),
            "velocity": variable(at, speed[..., every], units.of_velocity, units.derivative),
            "energy": variable(at, fell, "1", "energy", FORMULA),
            "section_theta": variable(period, wrapped, "rad", "angle, once a period"),
            "section_velocity": variable(period, speed[..., once], *rate),
            "section_time": variable(
                "period", units.given(raws[0].time[once], TIME), units.of_time, units.clock
            ),
            "event_time": variable(event, event_time, units.of_time, "time of the event"),
            "event_kind": variable(event, kinds, long_name="turn, stick or release"),
            "event_theta": variable(event, of.event_theta, "rad", "angle of the event"),
        },
        coords={
            "time": variable("time", clock, units.of_time, units.clock),
            "period": variable("period", np.arange(once.size), "1", "number of the period"),
        },
    )


def _refuse_strong(pendulum: Pendulum) -> None:
    """Raise InputError for a drive whose trajectories take too long."""
    if abs(pendulum.p) > _STRONGEST:
        raise InputError(
            f"p must be at most {_STRONGEST:g} times gravity, got {pendulum.p:g}: the number "
            "of steps grows with its root"
        )


def _refuse(given: dict[str, bool], *, timed: bool, several: bool) -> None:
    """Raise InputError for a choice that chosen times, or several starts, do not allow."""
    for name, there in given.items():
        if there and (timed or (several and name == "live")):
            why = "with t_eval" if timed else "with several starts"
            raise InputError(f"{name} must be left out {why}")


def _sampled(
    wanted: Floats | None, pendulum: Pendulum, units: Units
) -> tuple[Floats, Indices, Indices]:
    """Return times for the core, and the places of samples and section; empty for equal samples."""
    none = np.zeros(0, dtype=np.intp)
    if wanted is None:
        return np.zeros(0), none, none
    asked, period = units.bare(wanted, TIME), pendulum.period
    count = math.floor(asked[-1] / period * (1 + 1e-14)) + 1
    once = np.minimum(period * np.arange(count), asked[-1])
    times = np.union1d(once, asked)
    return times, np.searchsorted(times, asked), np.searchsorted(times, once)


def _one(theta: ArrayLike, velocity: ArrayLike) -> tuple[Floats, Floats]:
    """Return one start as two arrays of length 1."""
    pair = check_number("theta", theta), check_number("velocity", velocity)
    return np.array(pair[:1]), np.array(pair[1:])


def _times(until: float | None, t_eval: ArrayLike | None) -> tuple[float, Floats | None]:
    """Return the last time, and the times of the samples if they are given."""
    if t_eval is None:
        if until is None:
            raise InputError("until must be a time above 0 where t_eval is left out, got None")
        until = check_number("until", until)
        if until <= 0:
            raise InputError(f"until must be a time above 0, got {until:g}")
        return until, None
    wanted = ascending("t_eval", t_eval)
    if wanted[0] < 0 or wanted[-1] <= 0:
        raise InputError(f"t_eval must be times from 0, the last above 0, got {short_repr(t_eval)}")
    if until is not None and wanted[-1] > check_number("until", until):
        raise InputError(f"t_eval must end by until = {until:g}, got {wanted[-1]:g}")
    return float(wanted[-1]), wanted


def _smooth(pendulum: Pendulum, velocity: float, until: float) -> int:
    """Return the samples a period for a smooth curve, from an estimate of the largest speed."""
    periods = max(until / pendulum.period, 1.0)
    pulled = abs(velocity) + abs(pendulum.torque) * until
    if pendulum.gamma > 0:
        pulled = min(pulled, abs(pendulum.torque) / pendulum.gamma)
    speed = max(abs(velocity), 2 * math.sqrt(1 + abs(pendulum.p)), pulled)
    wanted = min(pendulum.period * speed / _APART, MOST_SAMPLES)
    return int(min(math.ceil(wanted), _SMOOTH_SAMPLES // periods))


def _exponent(raw: _core.Trajectory, time: Floats, units: Units) -> dict[str, float]:
    """Return the exponent with its standard error, and the times between which it was measured."""
    if raw.exponent is None:
        return {}
    first = int(_ALIGNMENT * time.size)
    size = max(1, (time.size - first) // _BATCHES)
    last = first + (time.size - first) // size * size - 1
    return {
        "exponent": units.given(raw.exponent[0], RATE),
        "exponent_stderr": units.given(raw.exponent[1], RATE),
        "exponent_from": float(time[max(first - 1, 0)]),
        "exponent_to": float(time[last]),
    }


def _summary(dataset: xr.Dataset, units: Units) -> list[str]:
    a = facts(dataset)
    theta, velocity = (float(dataset[key].values[-1]) for key in ("theta", "velocity"))
    turns, lines = "", []
    if a["turns"]:
        way = "forward" if a["turns"] > 0 else "backward"
        turns = f" ({counted(abs(a['turns']), 'full turn')} {way})"
    if a.get("interrupted"):
        asked = units.at(format(a["until_asked"], "g"))
        lines.append(f"INTERRUPTED before {asked}: the result ends where the computation stopped.")
    error = a["end_error"]
    at_end = f" and by {error:.1e} at the end" if math.isfinite(error) else ""
    lines.append(
        f"At {units.at(format(a['until'], 'g'))}: theta = {theta:.9g} rad{turns}, velocity = "
        f"{units.spoken(format(velocity, '.9g'))}."
    )
    lines.append(
        f"A 16 times smaller error of each step changes the state by {a['reached_error']:.1e} "
        f"after 5 periods{at_end} ({a['steps_per_period']} steps a period)."
    )
    if not a["reached_error"] <= a["tol"]:
        lines.append(
            f"THE TOLERANCE {a['tol']:g} WAS NOT REACHED: rounding, or the smallest step allowed, "
            f"leaves {a['reached_error']:.1e}."
        )
    rounding = float(np.spacing(np.abs(dataset["theta"].values).max()))
    if rounding > a["tol"]:
        lines.append(
            f"ANGLES ARE ROUNDED TO {rounding:.1e} rad because they are large: start nearer to 0."
        )
    if a["stuck"]:
        kinds, times = dataset["event_kind"].values, dataset["event_time"].values
        ever = ", permanently" if kinds[-1] == "stuck for ever" else ""
        lines.append(f"Friction holds it since {units.at(format(times[-1], '.9g'))}{ever}.")
    if a["end_error"] > max(1e-3, a["tol"]):
        lines.append(
            "The end is not predictable at this length: read the motion, not its last state."
        )
    if "exponent" in a:
        value, error = a["exponent"], a["exponent_stderr"]
        lines.append(
            f"Largest Lyapunov exponent of this stretch, {units.clock} = "
            f"{a['exponent_from']:.6g} to {units.seconds(format(a['exponent_to'], '.6g'))}: "
            f"{with_error(value, error)} {units.per_time}. Transients are included; basins gives "
            "the exponents of the attractors."
        )
    return lines


def energy(theta: Floats, velocity: Floats, attributes: Any) -> Floats:  # noqa: ANN401 (a mapping)
    """Return ``E / (m g l) = v^2 / 2 + 1 - cos theta``, ``v = d theta / d tau`` about the pivot."""
    speed = Units.of(attributes).bare(velocity, VELOCITY)
    energies: Floats = 0.5 * speed**2 + 1.0 - np.cos(theta)
    return energies
