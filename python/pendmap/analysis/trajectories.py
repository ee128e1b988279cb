"""Many starts: their trajectories as one result, and their states some periods later."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Unpack

import numpy as np

from pendmap import _core
from pendmap.analysis.grid import starts
from pendmap.analysis.numerics import Numerics, optional_whole
from pendmap.analysis.run import RunOptions
from pendmap.errors import MOST_PERIODS, InputError, check_number, check_whole, core_errors
from pendmap.files.variables import variable
from pendmap.formatting import counted
from pendmap.model import without_dimensions
from pendmap.units import VELOCITY

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from pendmap.analysis.run import Keywords
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats
    from pendmap.units import Units

_MOST_STEPS = 2_000_000  # Largest number of steps a period


def alike(theta: ArrayLike, velocity: ArrayLike) -> tuple[ArrayLike, ArrayLike]:
    """Return angles and velocities of several starts; a number as often as the other's values."""
    if np.ndim(theta) == 0:
        theta = np.full(np.shape(velocity), check_number("theta", theta))
    if np.ndim(velocity) == 0:
        velocity = np.full(np.shape(theta), check_number("velocity", velocity))
    if np.size(theta) == 0:
        raise InputError("theta must have one start or more, got none")
    return theta, velocity


class Rows(NamedTuple):
    """Arrays of several trajectories, a row each; missing events are nan, their kind is empty."""

    theta: Floats
    velocity: Floats
    event_time: Floats
    event_theta: Floats
    event_kind: NDArray[np.str_]


def rows_of(raws: Sequence[_core.Trajectory]) -> Rows:
    """Return the samples and events of trajectories with common times."""
    shape = len(raws), max(len(raw.event_kind) for raw in raws)
    times, angles = np.full((2, *shape), np.nan)
    kinds = np.full(shape, "", dtype="U14")
    for k, raw in enumerate(raws):
        count = len(raw.event_kind)
        times[k, :count], angles[k, :count] = raw.event_time, raw.event_theta
        kinds[k, :count] = raw.event_kind
    theta, velocity = (np.stack([getattr(raw, n) for raw in raws]) for n in ("theta", "velocity"))
    return Rows(theta, velocity, times, angles, kinds)


def several_facts(
    dataset: xr.Dataset,
    all_facts: Sequence[Mapping[str, float]],
    angles: Floats,
    speeds: Floats,
    units: Units,
) -> None:
    """Set the facts of each trajectory over ``start``, nan where one has none."""
    for name in dict.fromkeys(name for facts in all_facts for name in facts):
        known = dataset[name]
        values = np.array([facts.get(name, np.nan) for facts in all_facts])
        dataset[name] = ("start", values.astype(known.dtype), known.attrs)
    first = variable("start", angles, "rad", "angle at the start")
    second = variable("start", speeds, units.of_velocity, "velocity at the start")
    dataset.coords.update({"theta0": first, "velocity0": second})


def several_lines(dataset: xr.Dataset, units: Units) -> list[str]:
    """Return the summary of several trajectories."""
    last, held = units.at(format(dataset.attrs["until"], "g")), int(dataset["stuck"].sum())
    many = counted(dataset.sizes["start"], "start")
    lines = [f"{many} up to {last}; friction holds {held} of them at the end."]
    missed = int((dataset["reached_error"] > dataset.attrs["tol"]).sum())
    if missed:
        tol = format(dataset.attrs["tol"], "g")
        lines.append(f"THE TOLERANCE {tol} WAS NOT REACHED by {missed} of them.")
    return lines


def advance(  # noqa: PLR0913
    pendulum: Pendulum | Rig,
    theta: ArrayLike,
    velocity: ArrayLike,
    periods: int,
    *,
    tol: float = 1e-6,
    steps_per_period: int | None = None,
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
    steps_per_period : int, optional
        Steps a period; by default chosen by ``tol``.
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
    angles, speeds = starts(theta, velocity)
    speeds = units.bare(speeds, VELOCITY)
    periods = check_whole("periods", periods, 0, MOST_PERIODS)
    steps = optional_whole("steps_per_period", steps_per_period, 1, _MOST_STEPS)
    with core_errors():
        if steps is None:
            every = max(1, angles.size // 400)
            sample = angles[::every].copy(), speeds[::every].copy()
            steps, _ = _core.choose_steps(pendulum, *sample, numerics.tol)
        end, speed, turns = _core.advance(
            pendulum, angles, speeds, periods, steps, run.workers, run.progress
        )
    return end, units.given(speed, VELOCITY), turns
