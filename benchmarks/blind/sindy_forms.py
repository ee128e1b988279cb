"""The two regressions of SINDy, strong and weak.

Both regress ``th''`` on the columns of ``sindy_features``. The base of every model (``sin th``,
``v``, ``sign v``) is projected out of target and features first, which is equivalent to never
thresholding it. Columns then have unit length, so that one threshold suits all.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pysindy
from scipy.linalg import cholesky, solve_triangular
from scipy.ndimage import gaussian_filter1d
from scipy.sparse import csr_array

from benchmarks.blind.sindy_features import columns, features, smoothed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from benchmarks.blind.sindy_features import Feature, States
    from pendmap.identification.runs import FitRun
    from pendmap.virtual_rig.equation import Parameters

    Floats = NDArray[np.float64]

POWER = 6
"""Exponent of the test functions ``(1 - s^2)^power`` of the weak form."""

REACH = 3.0
"""Cutoff of the strong form's Gaussian filter, in standard deviations."""

SEEN = 0.003
"""Least share of a feature after projection of the base: below it is smoothing error."""


@dataclasses.dataclass(frozen=True)
class Setting:
    """Configuration of a form and of its model selection.

    Parameters
    ----------
    form : str
        ``strong`` or ``weak``.
    optimizer : str
        ``stlsq``, ``sr3``, ``frols`` or ``ssr``.
    support : float
        Half the support of a test function, or of the strong form's filter, times w0.
    penalty : float
        Factor of BIC's penalty on a coefficient.
    best : bool
        Whether only the best shape of each effect is offered.
    """

    form: str
    optimizer: str
    support: float = 2.0
    penalty: float = 1.0
    best: bool = True


@dataclasses.dataclass(frozen=True)
class Prepared:
    """States of all runs, parameters of a first regression, features and their columns by run."""

    states: list[States]
    rig: Parameters
    features: list[Feature]
    columns: list[Floats]


@dataclasses.dataclass(frozen=True)
class Regression:
    """Target and columns with the base projected out, in standard errors of the target."""

    target: Floats
    columns: Floats
    features: list[Feature]
    freedom: int


def prepared(runs: Sequence[FitRun], width: float) -> Prepared:
    """Return the states, parameters and features that both forms use.

    Parameters
    ----------
    runs : sequence of FitRun
        The records of an experiment.
    width : float
        Factor of the smoothing window, see ``sindy_features.smoothed``.
    """
    every, rig = smoothed(runs, width)
    pool = features(every, rig)
    return Prepared(every, rig, [f for _, f in pool], [columns(s, rig, pool) for s in every])


def regression(data: Prepared, setting: Setting) -> Regression:
    """Return the regression of an experiment's records in one of the forms."""
    form = _strong if setting.form == "strong" else _weak
    rows = [
        form(states, data.rig, extra, setting)
        for states, extra in zip(data.states, data.columns, strict=True)
    ]
    target, base, extra = (np.concatenate(part) for part in zip(*rows, strict=True))
    q = np.linalg.qr(base)[0]
    target = target - q @ (q.T @ target)
    length = np.linalg.norm(extra, axis=0)
    extra = extra - q @ (q.T @ extra)
    left = np.linalg.norm(extra, axis=0)
    seen = left > SEEN * np.maximum(length, 1e-300)
    kept = [feature for feature, here in zip(data.features, seen, strict=True) if here]
    return Regression(target, extra[:, seen] / left[seen], kept, len(target) - base.shape[1])


def _strong(
    states: States, rig: Parameters, extra: Floats, setting: Setting
) -> tuple[Floats, Floats, Floats]:
    """Return rows of ``th'' = ...``, one standard deviation of the smoothing apart.

    The derivative is of the smoothed angle, by differences. The features pass through the same
    filter, and have the same smoothing error.
    """
    spread = setting.support / rig.w0 / states.interval / REACH
    reach = math.ceil(setting.support / rig.w0 / states.interval) + 4

    def smooth(values: Floats) -> Floats:
        return np.asarray(gaussian_filter1d(values, spread, axis=0, truncate=REACH), np.float64)

    rate = pysindy.FiniteDifference(order=4)
    slope = rate(smooth(states.run.theta[:, None]), states.interval)
    target = np.asarray(rate(slope, states.interval))[:, 0]
    bad = np.concatenate([[0], np.cumsum(~states.good)])
    rows = np.arange(reach, target.size - reach, max(round(spread), 1))
    rows = rows[bad[rows + reach + 1] == bad[rows - reach]]
    pull = -(1 + states.vertical) * np.sin(states.run.theta)
    base = smooth(np.column_stack([pull, states.base[:, 1:]]))
    return target[rows], base[rows], smooth(extra)[rows]


def _weak(
    states: States, rig: Parameters, extra: Floats, setting: Setting
) -> tuple[Floats, Floats, Floats]:
    """Return rows of ``int phi'' th = int phi (...)``, whitened by their common noise.

    The angle of target and of ``sin th`` is the reading itself: its noise enters both, by ``phi'' +
    phi w0^2 (1 + a) cos th`` to first order; the velocity's integral is by parts too. Noise of the
    velocity moves a turning point, and gives dry friction the wrong sign meanwhile.
    """
    theta, dt = states.run.theta, states.interval
    half = max(round(setting.support / rig.w0 / dt), 8)
    s = np.arange(-half, half + 1) / half
    span = half * dt
    phi = (1 - s**2) ** POWER
    first = -2 * POWER * s * (1 - s**2) ** (POWER - 1) / span
    second = 2 * POWER * (1 - s**2) ** (POWER - 2) * ((2 * POWER - 1) * s**2 - 1) / span**2
    bad = np.concatenate([[0], np.cumsum(~states.good)])
    middles = np.arange(half, theta.size - half, max(half // 4, 1))
    middles = middles[bad[middles + half + 1] == bad[middles - half]]
    if middles.size == 0:
        return np.zeros(0), np.zeros((0, 3)), np.zeros((0, extra.shape[1]))

    def against(weights: Floats) -> csr_array:
        index = (middles[:, None] + np.arange(-half, half + 1)).ravel()
        ends = np.arange(middles.size + 1) * s.size
        return csr_array(
            (np.tile(weights * dt, middles.size), index, ends), shape=(middles.size, theta.size)
        )

    smooth, twice = against(phi), against(second)
    pull = -(1 + states.vertical)
    base = np.stack(
        [
            smooth @ (pull * np.sin(theta)),
            against(first) @ theta,
            -(smooth @ np.sign(states.velocity)),
        ],
        axis=1,
    )
    stiff = rig.w0**2 * (1 + states.vertical) * np.cos(states.theta)
    noise = twice + smooth.multiply(stiff[None, :])
    sigma = float(np.median(states.run.sigma))
    spread = (noise @ noise.T).toarray() * sigma**2
    turns = np.flatnonzero(np.diff(np.sign(states.velocity)) != 0)
    late = states.velocity_noise / np.maximum(np.abs(states.acceleration[turns]), rig.friction)
    moved = smooth[:, turns].toarray() * (2 * rig.friction / dt * late)
    spread += moved @ moved.T
    spread += 1e-6 * np.mean(np.diag(spread)) * np.eye(len(spread))
    root = cholesky(spread, lower=True)
    white = [
        solve_triangular(root, part, lower=True) for part in (twice @ theta, base, smooth @ extra)
    ]
    return white[0], white[1], white[2]
