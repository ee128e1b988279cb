"""Many starts: their trajectories as one result, and their states some periods later."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import result
from pendmap.analysis.grid import starts
from pendmap.analysis.numerics import Numerics, optional_whole
from pendmap.analysis.result import summarised, variable
from pendmap.errors import MOST_PERIODS, InputError, check_number, check_whole, core_errors
from pendmap.formatting import counted
from pendmap.model import without_dimensions
from pendmap.units import VELOCITY

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from pendmap.analysis.numerics import Progress
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats

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


def together(found: list[xr.Dataset], pendulum: Pendulum | Rig) -> xr.Dataset:
    """Return the results of several starts as one, over ``start``."""
    events = np.arange(max(each.sizes["event"] for each in found), dtype=np.int32)
    alike = [each.reindex(event=events, fill_value={"event_kind": ""}) for each in found]
    dataset = xr.concat(
        alike,
        "start",
        data_vars="all",
        coords="minimal",
        compat="override",
        combine_attrs="override",
    )
    dataset["event_kind"] = dataset["event_kind"].astype("U14")
    units = pendulum.units
    for name, unit, text in (
        ("theta0", "rad", "angle at the start"),
        ("velocity0", units.of_velocity, "velocity at the start"),
    ):
        values = np.array([each.attrs[name] for each in found])
        dataset.coords[name] = variable("start", values, unit, text)
        del dataset.attrs[name]
    dataset.coords.update(result.indices(dataset))
    dataset.attrs["steps_per_period"] = max(each.attrs["steps_per_period"] for each in found)
    last, held = units.at(format(dataset.attrs["until"], "g")), int(dataset["stuck"].sum())
    lines = [
        f"{counted(len(found), 'start')} up to {last}; friction holds {held} of them at the end."
    ]
    tol = dataset.attrs["tol"]
    missed = int((dataset["reached_error"] > tol).sum())
    if missed:
        lines.append(f"THE TOLERANCE {tol:g} WAS NOT REACHED by {missed} of them.")
    summarised(dataset, lines, pendulum, "angles and velocities here are")
    return dataset


def advance(  # noqa: PLR0913
    pendulum: Pendulum | Rig,
    theta: ArrayLike,
    velocity: ArrayLike,
    periods: int,
    *,
    tol: float = 1e-6,
    steps_per_period: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
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
    tol, threads, progress
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
    numerics = Numerics(tol, threads=threads, progress=progress)
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
            pendulum, angles, speeds, periods, steps, numerics.workers, progress
        )
    return end, units.given(speed, VELOCITY), turns
