"""Frequencies and instants of periodic and impulsive torques found in residuals.

A torque ``f`` at time ``s`` moves the angle at ``t`` by ``(a(s) b(t) - b(s) a(t))/W(s)`` times
``f ds``, with the derivatives ``a`` and ``b`` of the angle by the initial angle and velocity, and
their Wronskian ``W``, ``exp(-c t/m)`` with viscous damping alone. Inner products of the residuals
with the response to a torque at each time are thus two cumulative sums, those with a periodic
torque their Fourier transform. Gains are their squares over their variance from noise.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.identification.runs import FitRun
    from pendmap.identification.sensitivity import WindowSlopes
    from pendmap.signal import Floats


KEPT: Final = 4  # Number of frequencies returned; fewest readings of a window
PARTS: Final = 10  # Number of parts of the records in which one instant each is returned
FINE: Final = 4  # Oversampling of the frequency grid, relative to one over the records' duration
MOST: Final = 1 << 18  # Most frequencies tried
GROWTH: Final = 30.0
"""Growth of initial deviations, over the least of all windows, up to which a window is used."""
LOOKED_AT: Final = 4  # Number of frequencies whose exact gain is computed, over KEPT
DRAWS: Final = 32  # Noise samples from which the variance of the products is estimated


@dataclasses.dataclass(frozen=True)
class Response:
    """Linear response of a window's readings to torques, by the formula of the module."""

    time: Floats  # Laboratory time, s
    cosine: Floats  # Cosine of the angle
    residual: Floats  # Residuals over the standard errors, orthogonal to the basis
    states: Floats  # Derivatives by the initial angle and velocity, over the standard errors
    kernel: Floats  # Factors ``-b/W`` and ``a/W`` of later ``a`` and ``b``
    basis: Floats  # Orthonormal basis of the columns of ``states``

    def pull(self, residual: Floats) -> Floats:
        """Return the inner product of residuals with the response to a torque at each time."""
        later = _later(self.states * residual[:, None])
        return np.asarray(np.einsum("nk,nk->n", self.kernel, later), np.float64)

    def answer(self, impulse: NDArray[np.complex128]) -> Floats:
        """Return responses to real and imaginary part of impulses, with fitted initial states."""
        parts = np.stack([impulse.real, impulse.imag], axis=1)
        sums = np.cumsum(self.kernel[:, :, None] * parts[:, None, :], axis=0)
        columns = np.einsum("nk,nkp->np", self.states, sums)
        return np.asarray(columns - self.basis @ (self.basis.T @ columns), np.float64)

    def information(self) -> Floats:
        """Return the squared norm of each time's response, orthogonal to the initial states."""
        gram = _later(np.einsum("nj,nk->njk", self.states, self.states))
        whole = np.linalg.pinv(self.states.T @ self.states, hermitian=True)
        free = gram - gram @ whole @ gram
        left = np.einsum("nj,njk,nk->n", self.kernel, free, self.kernel)
        return np.asarray(left, np.float64)

    def noise(self, rng: np.random.Generator) -> Floats:
        """Return simulated residuals of white noise, orthogonal to the basis."""
        drawn = rng.standard_normal(self.residual.size)
        return np.asarray(drawn - self.basis @ (self.basis.T @ drawn), np.float64)


def _later(values: Floats) -> Floats:
    """Return the sum over all later samples at each sample."""
    return np.asarray(np.cumsum(values[::-1], axis=0)[::-1] - values, np.float64)


def calm_responses(
    runs: Sequence[FitRun], windows: Sequence[WindowSlopes], damping: float
) -> list[Response]:
    """Return the responses of windows in which deviations of the initial state grow little.

    In other windows the linear response is inaccurate; readings of rates are not used. ``damping``
    is ``c/m``, 1/s.
    """
    every, growth = [], []
    for window in windows:
        run = runs[window.run]
        weighted = np.flatnonzero(window.weight > 0)
        if weighted.size < KEPT or run.rod_sensor is not None:
            continue
        time = run.time[window.first + weighted]
        states, residual = window.states[weighted], window.residual[weighted]
        basis, _ = np.linalg.qr(states)
        angles = states / window.weight[weighted, None]
        a, b = angles.T
        wronskian = np.exp(damping * (time[0] - time))
        every.append(
            Response(
                time=run.lab_time_s + time,
                cosine=np.cos(run.theta[window.first + weighted]),
                residual=residual - basis @ (basis.T @ residual),
                states=states,
                kernel=np.stack([-b, a], axis=1) / wronskian[:, None],
                basis=basis,
            )
        )
        growth.append(float(np.abs(angles).max()))
    least = GROWTH * min(growth, default=0.0)
    return [response for response, by in zip(every, growth, strict=True) if by <= least]


def instants(responses: Sequence[Response]) -> list[float]:
    """Return the laboratory time, s, of the impulse with the greatest gain in each tenth."""
    gain = []
    for response in responses:
        pull, information = response.pull(response.residual), response.information()
        score = np.divide(pull**2, information, out=np.zeros_like(pull), where=information > 0)
        gain.append(score)
    both = np.concatenate([response.time for response in responses]), np.concatenate(gain)
    parts = zip(*(np.array_split(x, PARTS) for x in both), strict=True)
    return [float(of[np.argmax(score)]) for of, score in parts if score.size]


def frequencies(responses: Sequence[Response], most: float) -> list[float]:
    """Return the frequencies up to ``most``, rad/s, of the pivot sways with the greatest gains.

    Each window has its products ``P`` with ``exp(i w t)`` in its own time, and their moments from
    noise, ``E |P|^2`` and ``E P^2``; they are shifted in phase to laboratory time and summed.
    """
    first = min(response.time[0] for response in responses)
    span = max(response.time[-1] for response in responses) - first
    longest = max(float(np.ptp(response.time)) for response in responses)
    spacing = 0.5 * np.pi / most
    size = 1 << math.ceil(math.log2(FINE * (longest / spacing + 2)))
    coarse = 2 * np.pi * np.fft.rfftfreq(size, spacing)
    count = min(int(FINE * most * span / (2 * np.pi)), MOST)
    omega = most * np.arange(1, count + 1) / max(count, 1)
    # With less than one period in the records a torque cannot be distinguished from a drift.
    omega = omega[omega >= 2 * np.pi / span]
    if omega.size < 3:  # noqa: PLR2004 (no peak)
        return []
    rng = np.random.default_rng(0)
    pull, square, both = (np.zeros(omega.size, complex) for _ in range(3))
    for response in responses:
        place = ((response.time - response.time[0]) / spacing).astype(np.int64)
        step = np.gradient(response.time) * response.cosine
        values = np.stack([response.residual, *(response.noise(rng) for _ in range(DRAWS))])
        binned = [np.bincount(place, response.pull(v) * step, place[-1] + 1) for v in values]
        products = np.conj(np.fft.rfft(binned, size))
        turn = np.exp(1j * omega * (response.time[0] - first))
        pull += turn * np.interp(omega, coarse, products[0])
        square += turn**2 * np.interp(omega, coarse, np.mean(products[1:] ** 2, axis=0))
        both += np.interp(omega, coarse, np.mean(np.abs(products[1:]) ** 2, axis=0))
    # Squares of chaotic motions may overflow.
    unit = max(float(both.real.max()), 1e-300)
    pull, square, both = pull / math.sqrt(unit), square / unit, both / unit
    score = both.real * np.abs(pull) ** 2 - (square.conj() * pull**2).real
    score /= np.maximum(both.real**2 - np.abs(square) ** 2, 1e-300)
    peaks = np.flatnonzero((score[1:-1] > score[:-2]) & (score[1:-1] >= score[2:])) + 1
    peaks = peaks[np.argsort(-score[peaks])][: LOOKED_AT * KEPT]
    gains = [_exact_gain(responses, float(value)) for value in omega[peaks]]
    return _greatest(omega[peaks], np.array(gains), np.pi / longest)


def _exact_gain(responses: Sequence[Response], omega: float) -> float:
    """Return the gain of a pivot sway of one frequency, without simulated noise."""
    pull, information = np.zeros(2), np.zeros((2, 2))
    for response in responses:
        columns = response.answer(
            np.exp(1j * omega * response.time) * response.cosine * np.gradient(response.time)
        )
        pull += columns.T @ response.residual
        information += columns.T @ columns
    return float(pull @ np.linalg.pinv(information, hermitian=True) @ pull)


def _greatest(values: Floats, gains: Floats, apart: float) -> list[float]:
    """Return the values with the greatest gains that are more than ``apart`` from each other."""
    chosen: list[float] = []
    for k in np.argsort(-gains):
        if len(chosen) < KEPT and all(abs(values[k] - other) > apart for other in chosen):
            chosen.append(float(values[k]))
    return chosen
