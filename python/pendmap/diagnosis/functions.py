"""Candidates that are Python functions: scored to first order, never fitted.

The kernel cannot call a function that looks up a table or a trained model. Sampled along a fitted
motion, its torque changes the readings, to first order, by the integral of
:mod:`pendmap.residuals.torque`. With that response ``x``, over the standard errors and orthogonal
to the fitted parameters and initial states, and the residuals ``r``, the size is ``x' r / x' x``
and the sum of squares falls by ``(x' r)^2 / x' x``.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.diagnosis.scores import UNSEEN
from pendmap.errors import InputError, check_number, short_repr
from pendmap.residuals.torque import project_out, responses, window_derivatives

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from pendmap.comparison.data import DataSplit
    from pendmap.diagnosis.fitted_model import FittedModel
    from pendmap.records import Run
    from pendmap.signal import Floats

VISITED: Final = (0.05, 0.95)
"""Quantiles to which angles and velocities are clipped in a check: noise exceeds them."""


@dataclasses.dataclass(frozen=True)
class TorqueFunction:
    """A candidate effect whose torque is a Python function.

    It is fitted to first order only, never named, and cannot be part of a model, a trajectory or a
    map. For arithmetic functions :meth:`pendmap.Formula.of` makes a candidate without these limits.

    Parameters
    ----------
    name : str
        Name of the effect.
    function : callable
        ``function(theta, v, t, phase, parameters)`` of arrays of one length in SI: angle (rad, not
        wrapped), velocity (rad/s), time in the laboratory (s), phase of the harmonic drive (rad,
        in [-pi, pi]; 0 without). It returns the torque per moment of inertia, rad/s^2, of size 1.
    parameters : mapping of str to float
        Passed to the function unchanged.

    Raises
    ------
    InputError
        If the name is not a string, the function not callable, or a parameter not a number.

    Examples
    --------
    >>> from pendmap.diagnosis import TorqueFunction
    >>> TorqueFunction("kick", lambda theta, v, t, phase, p: p["k"] * v, {"k": 2}).parameters
    {'k': 2.0}
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
        """Return its torque along a motion, rad/s^2; InputError unless all values are finite."""
        phase = np.nan_to_num(place["drive_phase"])
        try:
            found = self.function(
                theta, place["velocity"], place["lab_time"], phase, dict(self.parameters)
            )
            values = np.broadcast_to(np.asarray(found, np.float64), theta.shape)
        except Exception as error:  # noqa: BLE001 (whatever a user's function may raise)
            said = " ".join(str(error).split())
            raise InputError(
                f"function '{self.name}' must accept arrays and return an array of equal length; "
                f"it raised {type(error).__name__}: {said}"
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
    """First-order score of a function."""

    name: str  # Of the function
    size: float  # Factor of its torque; NaN if the torque is undetectable
    stderr: float  # Standard error of the size
    gain: float  # Fall of the sum of squares at the baseline, over the noise's level
    left: float  # Fall of the sum of squares at the best model, in addition to its effects


def separate_functions(effects: object) -> tuple[list[TorqueFunction], list[Any]]:
    """Return the functions among a user's candidates, and all others; raise InputError."""
    if not isinstance(effects, list | tuple):
        shown = short_repr(effects)
        raise InputError(f"effects must be a list of Formula and TorqueFunction, got {shown}")
    functions = [effect for effect in effects if isinstance(effect, TorqueFunction)]
    return functions, [effect for effect in effects if not isinstance(effect, TorqueFunction)]


def check_functions(runs: Iterable[Run], functions: Sequence[TorqueFunction]) -> None:
    """Evaluate functions along the records, to report their errors before any fit.

    Angles and velocities of exactly 0, which occur in quantised readings only, are left out, since
    a function may be undefined there.
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


def score_functions(
    data: DataSplit, base: FittedModel, best: FittedModel, functions: Sequence[TorqueFunction]
) -> tuple[FunctionScore, ...]:
    """Score functions at a baseline and at a best model."""
    if not functions:
        return ()
    first = _scored(data, base, functions)
    last = first if best is base else _scored(data, best, functions)
    return tuple(
        FunctionScore(function.name, *one, other[2])
        for function, one, other in zip(functions, first, last, strict=True)
    )


def _scored(
    data: DataSplit, fitted: FittedModel, functions: Sequence[TorqueFunction]
) -> list[tuple[float, float, float]]:
    """Return size, standard error and gain of each function."""
    windows, places = window_derivatives(data.fitted, fitted.fit)
    columns = []
    for window, place in zip(windows, places, strict=True):
        own = slice(window.first, window.first + len(window.residual))
        theta = fitted.fit.curves[window.run][0][own]
        torques = np.stack([function.torque(place, theta) for function in functions], axis=1)
        columns.append(responses(data.fitted[window.run], window, torques))
    sizes = np.linalg.norm(np.concatenate(columns), axis=0)
    further, residual = project_out(data.fitted, windows, columns)
    level = fitted.noise.level
    found = []
    for k, size in enumerate(sizes):
        x = further[:, k]
        information = float(x @ x)
        if information <= (UNSEEN * float(size)) ** 2:
            found.append((math.nan, math.nan, 0.0))
            continue
        pull = float(x @ residual)
        found.append(
            (pull / information, math.sqrt(level / information), pull**2 / information / level)
        )
    return found
