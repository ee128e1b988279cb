"""Fits of pendulum swings around peaks and crossings with few samples, in blocks of turns."""

from __future__ import annotations

import dataclasses
import itertools
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.signal.robust import NORMAL_MAD

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.signal import Floats, Mask


BLOCK: Final = 12
"""Consecutive turns that share ``w0^2``, both dampings and the rest position."""
_ROUNDS: Final = 12  # Most Gauss-Newton steps
_SETTLED: Final = 6  # Iteration after which no more outliers are excluded
_LOSS: Final = 4  # Number of turns above which their damping is estimated
_OUTLIER: Final = 5.0  # Standard deviations beyond which a sample is excluded
_DOUBT: Final = 3.0  # Standard errors of a block's noise above which the model misfits


@dataclasses.dataclass(frozen=True)
class SwingFit:
    """Fitted turns, or crossings, of W windows."""

    instant: Floats  # s, shape (W,)
    state: Floats  # angle at a turn, rad, or velocity at a crossing, rad/s
    stderr_instant: Floats  # from the noise, the shared parameters, and the misfit, s
    stderr_state: Floats
    form: Floats  # w0^2, c_over_m, Tr, zero: (W, 4), equal within a block
    form_covariance: Floats  # shape (W, 4, 4)
    sigma: float  # noise of a sample, rad, given or estimated
    factor: Floats  # noise of each block over sigma, above 1 if the model misfits


def fit_swings(
    windows: Windows,
    start: tuple[Floats, Floats, Floats],
    *,
    sigma: float | None = None,
    known: SwingFit | None = None,
) -> SwingFit:
    """Fit instants and states of all windows, and the form (parameters) shared by each block.

    Gauss-Newton least squares. Each turn has its instant and state; a block of 12 turns has a
    common form, with wide priors (10 % of ``w0^2``, 100 % of the damping estimated from amplitudes)
    in case a few swings do not determine it. Blocks are independent, so any law of damping is
    represented by varying forms. Samples beyond 5 standard deviations are excluded. ``start`` has
    instants (W,), states (W,) and forms (W, 4). ``sigma``, rad, is by default that of the half of
    the blocks with the least noise. ``known`` forms are not fitted; their errors are propagated.
    """
    instant, state, form = (part.copy() for part in start)
    edges = np.linspace(0, instant.size, max(round(instant.size / BLOCK), 1) + 1).round()
    blocks = [slice(int(a), int(b)) for a, b in itertools.pairwise(edges)]
    prior = None if known is not None else _prior(instant, state, form, blocks)
    trial = windows
    for turn in range(_ROUNDS):
        local, shared, residual = _rows(trial, instant, state, form)
        if turn in {3, _SETTLED}:
            scale = _scales(residual, trial.used, blocks)
            far = np.abs(residual) > _OUTLIER * np.maximum(scale, sigma or 0.0)[:, None]
            far &= (trial.used & ~far).sum(axis=1, keepdims=True) > 2  # noqa: PLR2004 (unknowns)
            used = trial.used & ~far
            trial = dataclasses.replace(trial, used=used)
            local, shared, residual = (
                local * used[..., None],
                shared * used[..., None],
                residual * used,
            )
        held = None if prior is None else (*prior, form, _scales(residual, trial.used, blocks))
        move, _ = _step((local, shared, residual), blocks, held)
        instant += np.clip(move[:, 0], -0.1 / np.sqrt(form[:, 0]), 0.1 / np.sqrt(form[:, 0]))
        reach = 0.2 * np.abs(state) + 1e-9
        state += np.clip(move[:, 1], -reach, reach)
        state = np.where(windows.crossing, state, np.clip(state, -3.13, 3.13))
        form += move[:, 2:]
        form[:, 0] = np.clip(form[:, 0], 0.25 * start[2][:, 0], 4 * start[2][:, 0])
        if turn > _SETTLED and np.all(np.abs(move[:, 0]) * np.sqrt(form[:, 0]) < 1e-5):  # noqa: PLR2004
            break
    rows = _rows(trial, instant, state, form)
    return _errors(rows, blocks, (instant, state, form), trial.used, prior, sigma, known)


def _prior(
    instant: Floats, state: Floats, form: Floats, blocks: list[slice]
) -> tuple[Floats, Floats]:
    """Return mean and standard deviation of the form's prior, one row per window.

    The mean damping is that of the block's amplitudes, all viscous; the standard deviations allow
    any division between ``c_over_m`` and ``Tr``.
    """
    centre, wide = form.copy(), np.empty(form.shape)
    for block in blocks:
        size = max(float(np.median(np.abs(state[block]))), 1e-9)
        w2 = float(form[block][0, 0])
        w, loss = np.sqrt(w2), 0.0
        if block.stop - block.start > _LOSS:
            here = np.maximum(np.abs(state[block]), 1e-12)
            losses = 2 * np.log(here[:-2] / here[2:]) / (instant[block][2:] - instant[block][:-2])
            loss = max(float(np.median(losses)), 0.0)
        centre[block, 1] = loss
        spread = 0.01 * w + loss
        wide[block] = 0.1 * w2, spread, spread * w * size, 0.2 * size
    return centre, wide


def _rows(
    windows: Windows, instant: Floats, state: Floats, form: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return derivatives by instant and state (W, M, 2), by the form (W, M, 4), and residuals."""
    count = instant.size
    steps = np.stack(
        (
            1e-5 * np.maximum(np.abs(state), 1e-3),
            1e-5 * form[:, 0],
            1e-5 * np.sqrt(form[:, 0]),
            1e-6 * form[:, 0],
            np.full(count, 1e-6),
        )
    )
    states, forms = [state], [form]
    for k in range(1 + FORM):
        states.append(state + steps[0] if k == 0 else state)
        forms.append(form + (np.eye(FORM)[k - 1] * steps[k][:, None] if k else 0.0))
    fields = {f.name: getattr(windows, f.name) for f in dataclasses.fields(windows)}
    copies = {name: np.concatenate([part] * (2 + FORM)) for name, part in fields.items()}
    angle, speed = curves(
        Windows(**copies),
        np.concatenate([instant] * (2 + FORM)),
        np.concatenate(states),
        np.concatenate(forms),
    )
    angle = angle.reshape(2 + FORM, count, -1)
    change = np.stack([(angle[k + 1] - angle[0]) / steps[k][:, None] for k in range(1 + FORM)], -1)
    used = windows.used
    local = np.stack((-speed[:count], change[..., 0]), -1) * used[..., None]
    shared = change[..., 1:] * used[..., None]
    return local, shared, (windows.theta - angle[0]) * used


def _step(
    rows: tuple[Floats, Floats, Floats],
    blocks: list[slice],
    prior: tuple[Floats, Floats, Floats, Floats] | None,
) -> tuple[Floats, tuple[Floats, Floats, Floats]]:
    """Return the Gauss-Newton step, (W, 6), and the parts of the covariance for unit noise.

    The parts, one row per window: ``(L'L)^-1`` of instant and state, their derivatives by the form,
    and the form's inverse normal matrix.
    """
    local, shared, residual = rows
    across = np.swapaxes(local, 1, 2)
    inverse = np.asarray(np.linalg.pinv(across @ local, hermitian=True), np.float64)
    alone = (inverse @ (across @ residual[..., None]))[..., 0]
    follows = inverse @ (across @ shared)
    move: Floats = np.zeros((residual.shape[0], 2 + FORM))
    form_inverse: Floats = np.zeros((residual.shape[0], FORM, FORM))
    if prior is None:
        move[:, :2] = alone
        return move, (inverse, follows, form_inverse)
    free = shared - local @ follows
    left = residual - (local @ alone[..., None])[..., 0]
    centre, wide, form, scale = prior
    for block in blocks:
        hold = np.square(max(float(scale[block][0]), 1e-12) / wide[block][0])
        normal = np.einsum("wmi,wmj->ij", free[block], free[block]) + np.diag(hold)
        pull = np.einsum("wmi,wm->i", free[block], left[block])
        pull += hold * (centre[block][0] - form[block][0])
        # Parameters differ by orders of magnitude: scale the matrix before inversion.
        unit = 1 / np.sqrt(np.diag(normal))
        solved = np.linalg.pinv(normal * np.outer(unit, unit), hermitian=True) * np.outer(
            unit, unit
        )
        move[block, 2:] = solved @ pull
        form_inverse[block] = solved
    move[:, :2] = alone - (follows @ move[:, 2:, None])[..., 0]
    return move, (inverse, follows, form_inverse)


def _scales(residual: Floats, used: Mask, blocks: list[slice]) -> Floats:
    """Return a robust estimate of each block's noise, rad, shape (W,)."""
    scale = np.ones(residual.shape[0])
    for block in blocks:
        some = np.abs(residual[block][used[block]])
        points, windows = some.size, block.stop - block.start
        freedom = max(points - 2 * windows - FORM, 1)
        scale[block] = float(np.median(some)) / NORMAL_MAD * np.sqrt(points / freedom)
    return scale


def _errors(  # noqa: PLR0913, PLR0917 (all of a fit)
    rows: tuple[Floats, Floats, Floats],
    blocks: list[slice],
    solution: tuple[Floats, Floats, Floats],
    used: Mask,
    prior: tuple[Floats, Floats] | None,
    sigma: float | None,
    known: SwingFit | None,
) -> SwingFit:
    instant, state, form = solution
    points = used.sum(axis=1)
    square = np.sum(rows[2] ** 2, axis=1)
    sizes = np.array([block.stop - block.start for block in blocks])
    freedom = np.add.reduceat(points, [block.start for block in blocks]) - 2 * sizes
    freedom = np.maximum(freedom - (FORM if known is None else 0), 1.0)
    noise = np.sqrt(np.array([float(square[b].sum()) for b in blocks]) / freedom)
    if known is not None:
        sigma, factor = known.sigma, known.factor
    else:
        if sigma is None:
            quiet = noise <= np.median(noise)
            some = freedom[quiet]
            sigma = float(np.sqrt(np.sum(some * noise[quiet] ** 2) / some.sum()))
            even = noise**2 <= sigma**2 * (1 + 2 * _DOUBT * np.sqrt(2 / freedom))
            sigma = float(np.sqrt(np.sum((freedom * noise**2)[even]) / freedom[even].sum()))
        sigma = max(sigma, 1e-15)
        doubt = noise / sigma > 1 + _DOUBT * np.sqrt(0.5 / freedom)
        factors = np.where(doubt, noise / sigma, 1.0)
        factor = np.repeat(factors, sizes)
    held = None if prior is None else (*prior, form, np.full(points.size, sigma))
    _, (inverse, follows, form_inverse) = _step(rows, blocks, held)
    scale = (sigma * factor) ** 2
    shared = form_inverse * scale[:, None, None] if known is None else known.form_covariance
    covariance = inverse * scale[:, None, None] + follows @ shared @ np.swapaxes(follows, 1, 2)
    error = np.sqrt(np.maximum(np.einsum("wii->wi", covariance), 0.0))
    # Windows with too few samples are undetermined.
    open_ = points < 2  # noqa: PLR2004 (instant and state)
    error[open_] = np.inf
    return SwingFit(instant, state, error[:, 0], error[:, 1], form, shared, sigma, factor)


FORM: Final = 4
"""Parameters of the form: ``w0^2``, ``c_over_m``, ``Tr`` and the rest position ``zero``."""

_STEPS: Final = 20
"""Runge-Kutta steps per half window: the error over 2.5 rad of phase is at most 1e-5 rad."""


@dataclasses.dataclass(frozen=True)
class Windows:
    """Samples around W instants, in rows of equal length M."""

    time: Floats  # s, shape (W, M)
    theta: Floats  # rad
    used: Mask  # False for padding of shorter rows and excluded samples
    crossing: Mask  # True for a zero crossing, False for a turn, shape (W,)
    held: Mask  # whether the pendulum is held before the turn
    side: Floats  # sign of the turn, or of the velocity at the crossing

    @classmethod
    def around(
        cls,
        record: tuple[Floats, Floats],
        spans: Sequence[tuple[float, float]],
        side: Sequence[float],
        *,
        crossing: bool = False,
        held: bool = False,
    ) -> Windows:
        """Return windows with the samples within spans of time; ``held`` applies to the first."""
        t, x = record
        edges = [np.searchsorted(t, (low, high + 1e-9 * (high - low))) for low, high in spans]
        first = np.array([e[0] for e in edges], np.intp)
        count = np.array([e[1] - e[0] for e in edges], np.intp)
        places = np.arange(max(int(count.max(initial=1)), 1))
        used = places < count[:, None]
        rows = np.minimum(first[:, None] + places, t.size - 1)
        was_held = np.zeros(len(spans), bool)
        was_held[:1] = held
        signs = np.asarray(side, float)
        return cls(t[rows], x[rows], used, np.full(len(spans), crossing), was_held, signs)


def curves(windows: Windows, instant: Floats, state: Floats, form: Floats) -> tuple[Floats, Floats]:
    """Return angle (rad) and velocity (rad/s) at the samples of windows, shape (W, M).

    Each window's curve solves ``th'' + c_over_m th' + Tr sgn(th') + w0^2 sin(th - zero) = 0`` from
    its instant to both sides; ``sgn(th')`` is that of the half cycle on each side, so windows must
    end before the next turn. ``state`` is the angle at a turn or the velocity at a crossing.
    """
    lag = np.where(windows.used, windows.time - instant[:, None], 0.0)
    angle, speed = np.empty(lag.shape), np.empty(lag.shape)
    begin = np.where(windows.crossing, 0.0, state), np.where(windows.crossing, state, 0.0)
    for way in (1.0, -1.0):
        reach = np.maximum((way * lag).max(axis=1), 1e-12)
        sign = np.where(windows.crossing, windows.side, -way * windows.side)
        path = _integrated(begin, way * reach / _STEPS, sign, form)
        at = np.clip(way * lag / reach[:, None] * _STEPS, 0, _STEPS)
        here = way * lag >= 0
        x, v = _between(path, at, way * reach / _STEPS)
        angle, speed = np.where(here, x, angle), np.where(here, v, speed)
    before = windows.held[:, None] & (lag < 0)
    return np.where(before, state[:, None], angle), np.where(before, 0.0, speed)


def _acceleration(x: Floats, v: Floats, sign: Floats, form: Floats) -> Floats:
    return np.asarray(-form[:, 0] * np.sin(x - form[:, 3]) - form[:, 1] * v - form[:, 2] * sign)


def _integrated(
    begin: tuple[Floats, Floats], step: Floats, sign: Floats, form: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return angle, velocity, acceleration, (W, steps + 1), by the classical Runge-Kutta method."""
    x, v = begin
    rows = [(x, v, _acceleration(x, v, sign, form))]
    for _ in range(_STEPS):
        a1 = rows[-1][2]
        v2 = v + step / 2 * a1
        a2 = _acceleration(x + step / 2 * v, v2, sign, form)
        v3 = v + step / 2 * a2
        a3 = _acceleration(x + step / 2 * v2, v3, sign, form)
        v4 = v + step * a3
        a4 = _acceleration(x + step * v3, v4, sign, form)
        x = x + step / 6 * (v + 2 * v2 + 2 * v3 + v4)
        v = v + step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        rows.append((x, v, _acceleration(x, v, sign, form)))
    angle, speed, bend = (np.stack(part, axis=1) for part in zip(*rows, strict=True))
    return angle, speed, bend


def _between(
    path: tuple[Floats, Floats, Floats], at: Floats, step: Floats
) -> tuple[Floats, Floats]:
    """Return angle and velocity between the steps by cubic Hermite interpolation."""
    angle, speed, bend = path
    low = np.minimum(at.astype(np.intp), _STEPS - 1)
    s = at - low
    h = step[:, None]

    def cubic(value: Floats, slope: Floats) -> Floats:
        y0, y1 = (np.take_along_axis(value, low + k, 1) for k in (0, 1))
        d0, d1 = (h * np.take_along_axis(slope, low + k, 1) for k in (0, 1))
        rest = y1 - y0
        return np.asarray(y0 + s * (d0 + s * (3 * rest - 2 * d0 - d1 + s * (d0 + d1 - 2 * rest))))

    return cubic(angle, speed), cubic(speed, bend)
