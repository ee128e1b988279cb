"""Maps and trajectories in the project's schema, integrated with numpy alone.

They are computed by a plain fourth-order Runge-Kutta method, to test figures with real motions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

import synthetic

if TYPE_CHECKING:
    from collections.abc import Sequence

Floats = npt.NDArray[np.float64]
TWO_PI = 2.0 * math.pi


@dataclass(frozen=True)
class Run:
    """Stroboscopic states of many starts: shape (periods + 1, starts); angle in rad, unwrapped."""

    theta: npt.NDArray[np.float32]
    velocity: npt.NDArray[np.float32]
    growth: Floats


def strobe(  # noqa: PLR0913 (starts and parameters)
    theta: Floats,
    velocity: Floats,
    periods: int,
    *,
    gamma: float,
    p: float,
    omega: float,
    steps: int = 40,
) -> Run:
    """Integrate th'' + gamma th' + (1 + p cos omega tau) sin th = 0 and a tangent vector with RK4.

    ``growth`` is the logarithm of the tangent vector's growth over all periods, shape (starts,).
    """
    state = np.stack([theta, velocity, np.ones_like(theta), np.zeros_like(theta)])
    thetas, velocities = [theta.astype(np.float32)], [velocity.astype(np.float32)]
    growth = np.zeros_like(theta)
    h = TWO_PI / omega / steps

    def slope(tau: float, x: Floats) -> Floats:
        drive = 1.0 + p * math.cos(omega * tau)
        return np.stack(
            [
                x[1],
                -gamma * x[1] - drive * np.sin(x[0]),
                x[3],
                -gamma * x[3] - drive * np.cos(x[0]) * x[2],
            ]
        )

    for _ in range(periods):
        for i in range(steps):
            tau = i * h
            k1 = slope(tau, state)
            k2 = slope(tau + h / 2, state + h / 2 * k1)
            k3 = slope(tau + h / 2, state + h / 2 * k2)
            k4 = slope(tau + h, state + h * k3)
            state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        size = np.hypot(state[2], state[3])
        growth += np.log(size)
        state[2:] /= size
        thetas.append(state[0].astype(np.float32))
        velocities.append(state[1].astype(np.float32))
    return Run(np.array(thetas), np.array(velocities), growth)


def _name(n: int, w: int, *, at_rest: bool) -> tuple[str, str]:
    if at_rest:
        return "rest", "rest"
    if w:
        return f"rotation {n}:{w:+d}", "rotation"
    return f"oscillation {n}:0", "oscillation"


def integrated(
    *, p: float, gamma: float = 0.1, omega: float = 2.0, cells: int = 60, periods: int = 120
) -> xr.Dataset:
    """Return the basins of a pendulum whose attractors are periodic, ``cells`` a side."""
    theta, velocity = np.meshgrid(
        synthetic.centres(-math.pi, math.pi, cells), synthetic.centres(-3, 3, cells)
    )
    run = strobe(theta.ravel(), velocity.ravel(), periods, gamma=gamma, p=p, omega=omega)
    angle = synthetic.wrap(run.theta.astype(float)).astype(np.float32)
    label = np.zeros(cells * cells, dtype=np.int16)
    settle = np.full(cells * cells, -1, dtype=np.int32)
    found: list[synthetic.Painted] = []
    for i in range(label.size):
        if label[i] or len(found) >= 12:
            continue
        for n in range(1, 9):
            if (
                abs(synthetic.wrap(angle[-1, i] - angle[-1 - n, i]))
                + abs(run.velocity[-1, i] - run.velocity[-1 - n, i])
                < 2e-3
            ):
                break
        else:
            continue
        w = round(float(run.theta[-1, i] - run.theta[-1 - n, i]) / TWO_PI)
        points = np.stack([angle[-n:, i], run.velocity[-n:, i]], axis=1).astype(float)
        near = np.full(angle.shape, np.inf, dtype=np.float32)
        for x, v in points:
            np.minimum(near, np.abs(synthetic.wrap(angle - x)) + np.abs(run.velocity - v), out=near)
        mine = (label == 0) & (near[-1] < 0.02)
        label[mine] = len(found) + 1
        late = near[:, mine] > 0.1
        settle[mine] = late.shape[0] - np.argmax(late[::-1], axis=0)
        settle[mine & ~np.any(near > 0.1, axis=0)] = 0
        found.append(
            synthetic.Painted(*_name(n, w, at_rest=bool(np.abs(points).max() < 1e-2)), n, w, points)
        )
    stop = np.where(settle >= 0, settle, periods).clip(0, periods)
    reached = run.theta[stop, np.arange(label.size)]
    turns = np.round((reached - run.theta[0]) / TWO_PI).astype(np.int32)
    twins = [_twin(a, found) for a in found]
    named = [
        synthetic.Painted(a.name, a.kind, a.n, a.w, a.points, twin)
        for a, twin in zip(found, twins, strict=True)
    ]
    plane = label.reshape(cells, cells)
    swap = np.array([0, *twins], dtype=np.int16)
    unreliable = float(np.mean(swap[plane] != plane[::-1, ::-1]))
    return synthetic.assemble(
        named,
        plane,
        settle.reshape(cells, cells),
        turns.reshape(cells, cells),
        gamma=gamma,
        p=p,
        omega=omega,
        max_periods=periods,
        unreliable=unreliable,
        unreliable_mirror=unreliable,
        labels_reliable=int(unreliable <= 0.05),
        basin_entropy=0.65 if unreliable > 0.05 else 0.12,
        summary=(
            f"{len(found)} attractors at gamma = {gamma:g}, p = {p:g}, omega = {omega:g}, "
            f"found on {cells} x {cells} cells.\n"
            f"Mean settle time {settle[settle >= 0].mean():.1f} periods, longest {settle.max()}.\n"
            f"{unreliable:.1%} of the labels change under mirroring."
        ),
    )


def _twin(one: synthetic.Painted, found: Sequence[synthetic.Painted]) -> int:
    for k, other in enumerate(found):
        if abs(synthetic.wrap(one.points[0] + other.points)).sum(axis=1).min() < 0.02:
            return k + 1
    return 0


def chaotic(
    *, p: float = 1.7, gamma: float = 0.1, omega: float = 0.87, cells: int = 60, periods: int = 10
) -> xr.Dataset:
    """Return a map without meaningful labels: one chaotic attractor, or none (gamma = 0)."""
    theta, velocity = np.meshgrid(
        synthetic.centres(-math.pi, math.pi, cells), synthetic.centres(-3, 3, cells)
    )
    drive: dict[str, Any] = {"gamma": gamma, "p": p, "omega": omega}
    run = strobe(theta.ravel(), velocity.ravel(), periods, steps=60, **drive)
    shape = (cells, cells)
    found: list[synthetic.Painted] = []
    if gamma > 0:
        long = strobe(np.array([0.5, 1.0]), np.array([0.1, 0.2]), 600, steps=60, **drive)
        points = np.stack(
            [synthetic.wrap(long.theta[50:].ravel().astype(float)), long.velocity[50:].ravel()],
            axis=1,
        )
        found = [synthetic.Painted("tumbling chaos", "tumbling_chaos", 0, 0, points, 1)]
    return synthetic.assemble(
        found,
        np.full(shape, len(found), dtype=np.int16),
        np.full(shape, -1, dtype=np.int32),
        np.round((run.theta[-1] - run.theta[0]) / TWO_PI).astype(np.int32).reshape(shape),
        exponent=(run.growth / (periods * TWO_PI / omega)).astype(np.float32).reshape(shape),
        layers="finite_time",
        layer_periods=periods,
        undecided=0.0 if found else 1.0,
        summary="One chaotic attractor takes every start."
        if found
        else "Without damping there are no attractors.",
        **drive,
    )


def swing(  # noqa: PLR0913 (a start and parameters)
    *,
    p: float = 1.7,
    gamma: float = 0.1,
    omega: float = 0.87,
    theta: float = 1.0,
    velocity: float = 0.0,
    periods: int = 60,
    steps: int = 60,
) -> xr.Dataset:
    """Return one trajectory as ``pendmap.simulate`` does, ``steps`` samples a forcing period."""
    h = TWO_PI / omega / steps
    time = np.arange(periods * steps + 1) * h
    states = np.empty((time.size, 2))
    x = np.array([theta, velocity])
    states[0] = x

    def slope(tau: float, y: Floats) -> Floats:
        return np.array([y[1], -gamma * y[1] - (1 + p * math.cos(omega * tau)) * math.sin(y[0])])

    for i, tau in enumerate(time[:-1]):
        k1 = slope(tau, x)
        k2 = slope(tau + h / 2, x + h / 2 * k1)
        k3 = slope(tau + h / 2, x + h / 2 * k2)
        k4 = slope(tau + h, x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        states[i + 1] = x
    return xr.Dataset(
        {
            "theta": ("time", states[:, 0]),
            "velocity": ("time", states[:, 1]),
            "section_time": ("period", time[::steps]),
            "section_theta": ("period", synthetic.wrap(states[::steps, 0])),
            "section_velocity": ("period", states[::steps, 1]),
        },
        coords={"time": time, "period": np.arange(periods + 1)},
        attrs={
            "kind": "trajectory",
            "title": "Trajectory",
            "gamma": gamma,
            "p": p,
            "omega": omega,
            "phase": 0.0,
            "torque": 0.0,
            "theta0": theta,
            "velocity0": velocity,
            "until": float(time[-1]),
            "tol": 1e-6,
            "reached_error": 1e-7,
            "steps_per_period": steps,
            "turns": round(float(states[-1, 0] - states[0, 0]) / TWO_PI),
            "summary": "A trajectory.\nIt tumbles.",
            "pendmap_version": "0.1.0",
            "format_version": 1,
        },
    )
