"""Trajectories: one start, or several with common times; and states some periods later."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import xarray as xr

from pendmap import _core, errors
from pendmap.analysis import grid, result
from pendmap.analysis.result import Field, Found, Schema, summarised
from pendmap.analysis.run import Numerics, RunOptions
from pendmap.files import facts
from pendmap.files.variables import variable
from pendmap.formatting import counted, with_error
from pendmap.model import without_dimensions
from pendmap.units import RATE, TIME, VELOCITY, Units

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from pendmap.analysis.run import Keywords
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats, Indices

    Live = Callable[[Floats, Floats, Floats], object]


_SAMPLES = 64  # Default number of samples a period
_APART = 0.1  # Angle between two samples that looks smooth in the phase plane, rad
_SMOOTH_SAMPLES = 200_000  # Samples in all up to which there are more than 64 a period
_MOST_SAMPLES = 2_000_000  # Samples in all above which there are fewer than 64 a period
_STRONGEST = 1e6  # Acceleration of the pivot over gravity up to which a trajectory takes seconds


SCHEMA = Schema(
    "trajectory",
    result.UNITS,
    Field("t", result.OF_TIME, "last time", read=lambda d: d.attrs["until"]),
    Field("theta", "rad", "angle at the end, not wrapped", read=lambda d: float(d["theta"][-1])),
    Field("velocity", result.OF_VELOCITY, "the velocity", read=lambda d: float(d["velocity"][-1])),
    Found("stuck", result.FLAG, "whether friction holds the pendulum at the end", convert=bool),
    Found("turns", "1", "full turns between start and end"),
    result.TOL,
    Field(
        *("tol_reached", "", "whether the tolerance was reached"),
        read=lambda d: bool(d["reached_error"] <= d.attrs["tol"]),
    ),
    result.REACHED,
    Found("end_error", "1", "change of the end by a 16 times smaller error of each step"),
    Field("interrupted", "", "1 where Ctrl-C ended it", read=lambda d: "interrupted" in d.attrs),
    Field("energy", "m g l", "energy at the end", read=lambda d: float(d["energy"][-1])),
    result.SIMD,
    Found("exponent", result.OF_RATE, "Lyapunov exponent of this stretch", None, when="lyapunov"),
    Found("stderr", result.OF_RATE, "its error", None, when="lyapunov", variable="exponent_stderr"),
    result.MISSES,
    result.SUMMARY.hidden,
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
        or until rounding forbids more. ``reached_error`` is the error reached, ``end_error`` the
        difference at the end.
    samples : int, optional
        Samples a period; by default 64 or more, as many as a smooth curve needs, up to 200,000 in
        all; fewer than 64 where that would be more than two million. The motion does not depend on
        them, the batches of an exponent do.
    lyapunov : bool
        Whether to compute the largest Lyapunov exponent of this stretch of trajectory, with the
        standard error of 20 batches, the first tenth left out. A chaotic transient has a positive
        one, wherever it ends: :func:`pendmap.lyapunov` computes that of the attractor.
    live : callable, optional
        Called about every 50 ms, and at the end, with the times, angles and velocities of the
        samples that are new since the last call, in the units of the result. With it Ctrl-C ends
        the trajectory with the last sample instead of raising; the attribute ``interrupted`` is 1
        then. For one trajectory without ``t_eval``.

    Returns
    -------
    xarray.Dataset
        ``theta`` (not wrapped), ``velocity`` and ``energy`` (over m g l, ``v^2 / 2 + 1 - cos
        theta``, 0 at rest) over ``time``; ``section_theta`` (wrapped to (-pi, pi]) and
        ``section_velocity`` over ``period``; ``event_time``, ``event_kind`` (turn, stick, release,
        stuck for ever) and ``event_theta`` over ``event``, located to rounding. ``stuck`` is 1 if
        friction holds the pendulum at the end. With an array of starts all of these are over
        ``start`` too, nan and no kind in the place of events that a trajectory lacks.

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
    errors.check_callable("live", live, "three arrays, times, angles and velocities")
    numerics = Numerics(tol=tol)
    several = np.ndim(theta) > 0 or np.ndim(velocity) > 0
    angles, speeds = _starts(theta, velocity)
    lyapunov = errors.check_flag("lyapunov", lyapunov)
    until, wanted = _times(until, t_eval)
    given = {"samples": samples is not None, "lyapunov": lyapunov, "live": live is not None}
    for name, there in given.items():
        if there and (wanted is not None or (several and name == "live")):
            why = "with several starts" if wanted is None else "with t_eval"
            raise errors.InputError(f"{name} must be left out {why}")
    velocities, end = units.bare(speeds, VELOCITY), units.bare(until, TIME)
    samples = _samples(bare, samples, velocities, end, lyapunov=lyapunov)
    times = crossings = np.zeros(0)
    if wanted is not None:
        count = math.floor(end / bare.period * (1 + 1e-14)) + 1
        crossings = np.minimum(bare.period * np.arange(count), end)
        times = np.union1d(crossings, units.bare(wanted, TIME))

    def shown(times: Floats, angles: Floats, speeds: Floats) -> None:
        if live is not None:
            live(units.given(times, TIME), angles, units.given(speeds, VELOCITY))

    choices = (numerics.tol, samples, lyapunov, live and shown, times.tolist())
    with errors.core_errors():
        raws = [
            _core.simulate(bare, start, end, *choices)
            for start in zip(angles.tolist(), velocities.tolist(), strict=True)
        ]
    raw = raws[0]
    time = clock = units.given(raw.time, TIME)
    every, once = np.arange(time.size), np.arange(0, time.size, samples)
    if wanted is not None:
        every, once = (np.searchsorted(times, at) for at in (units.bare(wanted, TIME), crossings))
        clock = wanted
    elif raw.time[once[-1]] < (1 - 1e-9) * once[-1] / samples * bare.period:
        once = once[:-1]  # the end, between two samples
    dataset = _dataset(raws, every, once, clock, pendulum)
    of_starts = [_facts(path, angle, units) for path, angle in zip(raws, angles, strict=True)]
    values = {
        **numerics.provenance(),
        **{name: value for one in reversed(of_starts) for name, value in one.items()},
        "theta0": None if several else angles.item(),
        "velocity0": None if several else speeds.item(),
        "until": float(time[-1]) if raw.interrupted else until,
        "steps_per_period": max(path.steps_per_period for path in raws),
        "lyapunov": int(lyapunov),
    }
    values["stderr"] = values.pop("exponent_stderr", None)
    if raw.interrupted:
        values |= {"interrupted": 1, "until_asked": until}
    SCHEMA.complete(dataset, pendulum, values, raw)
    if not several:
        dataset = dataset.isel(start=0, drop=True)
        summarised(dataset, _summary(dataset, units), pendulum, "angle and velocity here are")
        return dataset
    _put(dataset, of_starts, angles, speeds)
    held, missed = int(dataset["stuck"].sum()), int((dataset["reached_error"] > numerics.tol).sum())
    line = f"{counted(angles.size, 'start')} up to {units.at(format(until, 'g'))}; friction holds "
    line += f"{held} of them at the end, and the tolerance was not reached by {missed}."
    summarised(dataset, [line], pendulum, "angles and velocities here are")
    return dataset


def _starts(theta: ArrayLike, velocity: ArrayLike) -> tuple[Floats, Floats]:
    """Return angles and velocities of the starts; a number as often as the other's values."""
    shape = np.shape(theta) or np.shape(velocity) or (1,)
    arrays = [
        value if np.ndim(value) else np.full(shape, errors.check_number(name, value))
        for name, value in (("theta", theta), ("velocity", velocity))
    ]
    angles, speeds = grid.starts(*arrays)
    if not angles.size:
        raise errors.InputError("theta must have one start or more, got none")
    return angles, speeds


def _times(until: float | None, t_eval: ArrayLike | None) -> tuple[float, Floats | None]:
    """Return the last time, and the times of the samples if they are given."""
    wanted = None if t_eval is None else grid.ascending("t_eval", t_eval)
    if wanted is None:
        end = 0.0 if until is None else errors.check_number("until", until)
        if end <= 0:
            text = "must be a time above 0 where t_eval is left out"
            raise errors.InputError(f"until {text}, got {until}")
        return end, None
    if wanted[0] < 0 or wanted[-1] <= 0:
        text = errors.short_repr(t_eval)
        raise errors.InputError(f"t_eval must be times from 0, the last above 0, got {text}")
    if until is not None and wanted[-1] > errors.check_number("until", until):
        raise errors.InputError(f"t_eval must end by until = {until:g}, got {wanted[-1]:g}")
    return float(wanted[-1]), wanted


def _samples(
    pendulum: Pendulum, given: int | None, speeds: Floats, until: float, *, lyapunov: bool
) -> int:
    """Return the samples a period; by default enough for a smooth curve, by the largest speed."""
    if abs(pendulum.p) > _STRONGEST:
        raise errors.InputError(
            f"p must be at most {_STRONGEST:g} times gravity, got {pendulum.p:g}: the number of "
            "steps grows with its root"
        )
    count, periods = speeds.size, max(until / pendulum.period, 1.0)
    samples = given
    if samples is None:
        samples = int(min(_SAMPLES, max(1, _MOST_SAMPLES // count // periods)))
    if given is None and not lyapunov:  # the batches of an exponent depend on the samples
        velocity = float(np.abs(speeds).max())
        pulled = velocity + abs(pendulum.torque) * until
        if pendulum.gamma > 0:
            pulled = min(pulled, abs(pendulum.torque) / pendulum.gamma)
        speed = max(velocity, 2 * math.sqrt(1 + abs(pendulum.p)), pulled)
        smooth = math.ceil(min(pendulum.period * speed / _APART, errors.MOST_SAMPLES))
        samples = max(samples, int(min(smooth, _SMOOTH_SAMPLES // periods)) // count)
    samples = errors.check_whole("samples", samples, 1, errors.MOST_SAMPLES)
    if periods * samples * count > 100 * _MOST_SAMPLES:
        most = f"{100 * _MOST_SAMPLES // samples // count:.3g} periods of {samples} samples"
        raise errors.InputError(f"until must be up to {most}, got {periods:.3g}: more do not fit")
    return samples


def _dataset(
    raws: list[_core.Trajectory],
    every: Indices,
    once: Indices,
    clock: Floats,
    pendulum: Pendulum | Rig,
) -> xr.Dataset:
    """Return the samples ``every``, at times ``clock``, the section at ``once``, and the events."""
    units = pendulum.units
    theta, speed = (np.stack([getattr(raw, n) for raw in raws]) for n in ("theta", "velocity"))
    speed = units.given(speed, VELOCITY)
    events = len(raws), max(len(raw.event_kind) for raw in raws)
    event_time, event_theta = np.full((2, *events), np.nan)
    kinds = np.full(events, "", dtype="U14")
    for k, raw in enumerate(raws):
        count = len(raw.event_kind)
        event_time[k, :count], event_theta[k, :count] = raw.event_time, raw.event_theta
        kinds[k, :count] = raw.event_kind
    wrapped = -np.remainder(math.pi - theta[:, once], math.tau) + math.pi
    energies = energy(theta[:, every], speed[:, every], pendulum.attributes)
    rate, crossings = units.of_velocity, units.given(raws[0].time[once], TIME)
    at, period, event = (("start", name) for name in ("time", "period", "event"))
    moments = units.given(event_time, TIME)
    formula = "(dtheta/dtau)^2 / 2 + 1 - cos(theta), over m g l"
    return xr.Dataset(
        {
            "theta": variable(at, theta[:, every], "rad", "angle, not wrapped"),
            "velocity": variable(at, speed[:, every], rate, units.derivative),
            "energy": variable(at, energies, "1", "energy", formula),
            "section_theta": variable(period, wrapped, "rad", "angle, once a period"),
            "section_velocity": variable(period, speed[:, once], rate, "velocity, likewise"),
            "section_time": variable("period", crossings, units.of_time, units.clock),
            "event_time": variable(event, moments, units.of_time, "time of the event"),
            "event_kind": variable(event, kinds, long_name="turn, stick or release"),
            "event_theta": variable(event, event_theta, "rad", "angle of the event"),
        },
        coords={
            "time": variable("time", clock, units.of_time, units.clock),
            "period": variable("period", np.arange(once.size), "1", "number of the period"),
        },
    )


def _facts(path: _core.Trajectory, angle: float, units: Units) -> dict[str, Any]:
    """Return the facts of one trajectory that began at an angle."""
    known = {
        "turns": math.trunc((float(path.theta[-1]) - angle) / math.tau),
        "stuck": int(path.stuck),
        "reached_error": path.reached_error,
        "end_error": path.end_error,
    }
    if path.exponent is None:
        return known
    value, error = units.given(np.array(path.exponent), RATE).tolist()
    return {"exponent": value, "exponent_stderr": error, **known}


def _put(
    dataset: xr.Dataset, of_starts: list[dict[str, Any]], angles: Floats, speeds: Floats
) -> None:
    """Set the starts, and the facts of their trajectories, nan where one has none."""
    rate = dataset["velocity"].attrs["units"]
    dataset.coords["theta0"] = variable("start", angles, "rad", "angle at the start")
    dataset.coords["velocity0"] = variable("start", speeds, rate, "velocity at the start")
    for name in dict.fromkeys(name for one in of_starts for name in one):
        column = np.array([one.get(name, np.nan) for one in of_starts])
        dataset[name] = ("start", column.astype(dataset[name].dtype), dataset[name].attrs)


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
    at_end = f" and by {a['end_error']:.1e} at the end" if math.isfinite(a["end_error"]) else ""
    lines.append(
        f"At {units.at(format(a['until'], 'g'))}: theta = {theta:.9g} rad{turns}, velocity = "
        f"{units.spoken(format(velocity, '.9g'))}."
    )
    lines.append(
        f"A 16 times smaller error of each step changes the state by {a['reached_error']:.1e} "
        f"after 5 periods{at_end} ({a['steps_per_period']} steps a period)."
    )
    if not a["reached_error"] <= a["tol"]:
        lines.append(f"THE TOLERANCE {a['tol']:g} WAS NOT REACHED: rounding forbids smaller steps.")
    rounding = float(np.spacing(np.abs(dataset["theta"].values).max()))
    if rounding > a["tol"]:
        lines.append(f"ANGLES ARE ROUNDED TO {rounding:.1e} rad: start nearer to 0.")
    if a["stuck"]:
        kinds, times = dataset["event_kind"].values, dataset["event_time"].values
        ever = ", permanently" if kinds[-1] == "stuck for ever" else ""
        lines.append(f"Friction holds it since {units.at(format(times[-1], '.9g'))}{ever}.")
    if a["end_error"] > max(1e-3, a["tol"]):
        lines.append("The end is not predictable: read the motion, not its last state.")
    if "exponent" in a:
        lines.append(
            "Largest Lyapunov exponent of this stretch, the first tenth left out: "
            f"{with_error(a['exponent'], a['exponent_stderr'])} {units.per_time}. Transients are "
            "included; basins gives the exponents of the attractors."
        )
    return lines


def energy(theta: Floats, velocity: Floats, attributes: Any) -> Floats:  # noqa: ANN401 (a mapping)
    """Return ``E / (m g l) = v^2 / 2 + 1 - cos theta``, ``v = d theta / d tau`` about the pivot."""
    speed = Units.of(attributes).bare(velocity, VELOCITY)
    return np.asarray(0.5 * speed**2 + 1.0 - np.cos(theta))


def advance(  # noqa: PLR0913 (as for basins)
    pendulum: Pendulum | Rig,
    theta: ArrayLike,
    velocity: ArrayLike,
    periods: int,
    *,
    tol: float = 1e-6,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Advance many starts by the same number of periods.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; with a rig velocities are in rad/s.
    theta, velocity : array_like, shape (N,)
        Angles in rad and velocities at ``tau = 0``.
    periods : int
        Forcing periods (of ``2 pi`` where p = 0); 0 or more.
    tol, run
        As for :func:`pendmap.basins`.

    Returns
    -------
    theta, velocity : ndarray, shape (N,)
        Angles wrapped to [-pi, pi] and velocities.
    turns : ndarray of int, shape (N,)
        Net full turns.

    Raises
    ------
    InputError
        If the lengths differ, a start is not finite, or a value is outside its range.

    Examples
    --------
    >>> import pendmap
    >>> pendulum = pendmap.Pendulum(gamma=0.1, p=0.6, omega=2.0)
    >>> theta, velocity, turns = pendmap.advance(pendulum, [0.5], [0.0], 40)
    >>> theta.round(3), velocity.round(3)
    (array([1.318]), array([-0.27]))
    """
    pendulum, units = without_dimensions(pendulum)
    run = RunOptions.of(run, options).in_memory("advance")
    numerics = Numerics(run, tol)
    angles, speeds = grid.starts(theta, velocity)
    speeds = units.bare(speeds, VELOCITY)
    periods = errors.check_whole("periods", periods, 0, errors.MOST_PERIODS)
    with errors.core_errors():
        every = max(1, angles.size // 400)
        sample = angles[::every].copy(), speeds[::every].copy()
        steps, _ = _core.choose_steps(pendulum, *sample, numerics.tol)
        end, speed, turns = _core.advance(
            pendulum, angles, speeds, periods, steps, run.workers, run.progress
        )
    return end, units.given(speed, VELOCITY), turns
