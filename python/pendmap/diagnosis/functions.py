"""Candidates that are Python functions of any kind: scored to first order, never refitted.

A function that looks up a table, or asks a trained model, is nothing that the kernel can step
with. But sampled along a fitted motion its torque ``u`` moves the readings, to first order, by the
integral that :mod:`pendmap.residuals.torque` has for any torque; with ``x`` that response
over the standard errors, what the fitted parameters and initial states can follow taken off, and
``r`` the residuals, the size is ``x' r / x' x`` and the sum of squares falls by
``(x' r)^2 / x' x``.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError, check_number, short_repr
from pendmap.residuals.torque import freed, responses, windows_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from pendmap.comparison.data import Evidence
    from pendmap.diagnosis.fitted_model import Trial
    from pendmap.records import Run

    Floats = NDArray[np.float64]

UNSEEN: Final = 1e-4
"""A torque of which the fitted parameters follow all but this part does nothing of its own."""

VISITED: Final = (0.05, 0.95)
"""Quantiles of readings and their differences between which the motion surely is, for all noise."""


@dataclasses.dataclass(frozen=True)
class TorqueFunction:
    """A torque that is whatever a Python function returns, as a candidate of a diagnosis.

    It is fitted to first order only, has no place in a model, a trajectory or a map, and is never
    named. Where the function is arithmetic, :meth:`pendmap.Formula.of` makes a candidate of it that
    has all of these.

    Parameters
    ----------
    name : str
        What it is called.
    function : callable
        ``function(theta, v, t, phase, parameters)`` of arrays of one length in SI: angle (rad, not
        wrapped), velocity (rad/s), time in the laboratory (s), phase of the harmonic drive (rad,
        in [-pi, pi]; 0 without); it returns the torque per moment of inertia, rad/s^2, that the
        size 1 stands for.
    parameters : mapping of str to float
        Handed over as they are.

    Raises
    ------
    InputError
        If the name is no text, the function none, or a parameter no number.
    """

    name: str
    function: Callable[..., Any]
    parameters: Mapping[str, float] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise InputError(f"name must be a text, got {short_repr(self.name)}")
        if not callable(self.function):
            shown = short_repr(self.function)
            raise InputError(f"function must be a function of five arguments, got {shown}")
        if not isinstance(self.parameters, Mapping):
            shown = short_repr(self.parameters)
            raise InputError(f"parameters must be a mapping of numbers, got {shown}")
        kept = {str(n): check_number(str(n), value) for n, value in self.parameters.items()}
        object.__setattr__(self, "parameters", kept)

    def torque(self, place: Mapping[str, Floats], theta: Floats) -> Floats:
        """Return its torque along a motion, rad/s^2.

        Raises
        ------
        InputError
            If the function fails, or returns something else than a finite number for each.
        """
        phase = np.nan_to_num(place["drive_phase"])
        try:
            found = self.function(
                theta, place["velocity"], place["lab_time"], phase, dict(self.parameters)
            )
            values = np.broadcast_to(np.asarray(found, np.float64), theta.shape)
        except Exception as error:  # noqa: BLE001 (whatever a user's function may raise)
            said = " ".join(str(error).split())
            raise InputError(
                f"function '{self.name}' must take arrays and return an array as long, it "
                f"fails with {type(error).__name__}: {said}"
            ) from None
        if not np.isfinite(values).all():
            k = int(np.flatnonzero(~np.isfinite(values))[0])
            raise InputError(
                f"function '{self.name}' must return finite numbers, got {values[k]} at "
                f"theta = {theta[k]:.4g} rad, v = {place['velocity'][k]:.4g} rad/s"
            )
        return values


@dataclasses.dataclass(frozen=True)
class FunctionScore:
    """What a function explains, to first order.

    Parameters
    ----------
    name : str
        The function.
    size, stderr : float
        By which its torque is to be multiplied, and the standard error of that; NaN where the
        records do not show it.
    gain : float
        By which the sum of squares falls, over the noise's level, at the baseline.
    left : float
        The same at the best model: what the function explains beyond the effects found.
    """

    name: str
    size: float
    stderr: float
    gain: float
    left: float


def divided(effects: object) -> tuple[list[TorqueFunction], list[Any]]:
    """Return a user's candidates: functions, and all others.

    Raises
    ------
    InputError
        If they are no list.
    """
    if not isinstance(effects, list | tuple):
        shown = short_repr(effects)
        raise InputError(f"effects must be a list of Formula and TorqueFunction, got {shown}")
    functions = [effect for effect in effects if isinstance(effect, TorqueFunction)]
    return functions, [effect for effect in effects if not isinstance(effect, TorqueFunction)]


def call_once(runs: Iterable[Run], functions: Sequence[TorqueFunction]) -> None:
    """Call functions where the pendulum was: what is wrong with them is said before any fit.

    Angles and velocities that are exactly 0 are left out: a motion passes them between two
    readings, where a reading in counts stays, and a function may be of no value there.
    """
    for run in runs if functions else ():
        time, theta = run.time[run.trusted], run.theta[run.trusted]
        if time.size < 2:  # noqa: PLR2004 (a difference)
            continue
        velocity = np.gradient(theta, time)
        theta, velocity = (np.clip(x, *np.quantile(x, VISITED)) for x in (theta, velocity))
        phase = np.full(time.size, np.nan)
        if run.drive is not None:
            turned = (run.drive["Omega"] or 0.0) * time + (run.drive["phi"] or 0.0)
            phase = np.angle(np.exp(1j * turned))
        which = (theta != 0) & (velocity != 0)
        place = {"velocity": velocity, "drive_phase": phase, "lab_time": run.lab_time_s + time}
        for function in functions:
            function.torque({name: x[which] for name, x in place.items()}, theta[which])


def function_scores(
    evidence: Evidence, base: Trial, best: Trial, functions: Sequence[TorqueFunction]
) -> tuple[FunctionScore, ...]:
    """Score functions at a baseline and at a best model."""
    if not functions:
        return ()
    first = _scored(evidence, base, functions)
    rest = first if best is base else _scored(evidence, best, functions)
    return tuple(
        FunctionScore(function.name, *one, other[2])
        for function, one, other in zip(functions, first, rest, strict=True)
    )


def _scored(
    evidence: Evidence, trial: Trial, functions: Sequence[TorqueFunction]
) -> list[tuple[float, float, float]]:
    """Return size, its standard error and gain of each."""
    windows, places = windows_of(evidence.fitted, trial.fit)
    columns = []
    for window, place in zip(windows, places, strict=True):
        own = slice(window.first, window.first + len(window.residual))
        theta = trial.fit.curves[window.run][0][own]
        torques = np.stack([function.torque(place, theta) for function in functions], axis=1)
        columns.append(responses(evidence.fitted[window.run], window, torques))
    sizes = np.linalg.norm(np.concatenate(columns), axis=0)
    further, residual = freed(evidence.fitted, windows, columns)
    level = trial.remainder.level
    found = []
    for k, size in enumerate(sizes):
        x = further[:, k]
        information = float(x @ x)
        # What the fitted parameters follow all but a trace of is not seen.
        if information <= (UNSEEN * float(size)) ** 2:
            found.append((math.nan, math.nan, 0.0))
            continue
        pull = float(x @ residual)
        found.append(
            (pull / information, math.sqrt(level / information), pull**2 / information / level)
        )
    return found
