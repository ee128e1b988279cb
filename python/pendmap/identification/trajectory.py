"""The best method: the whole record of a free decay against the equation of motion.

``th'' + c_over_m th' + w0**2 sin th = -Tr sign(th')``, with further terms by effects, is followed
from release to rest, stops included, and all its numbers are adapted to all readings at once
(:mod:`pendmap.identification.fitting`). Nothing is linearised, no peak is picked.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap import checks
from pendmap.errors import InputError
from pendmap.identification.clock import from_first, span
from pendmap.identification.free import SENSOR
from pendmap.identification.from_start import OFFSET, TooShortError, fit_from_start
from pendmap.identification.reading import Reading, reading_of
from pendmap.identification.result import Estimate, Identification
from pendmap.identification.runs import FitRun
from pendmap.model.effects import opposes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from pendmap.identification.fitting import TrajectoryFit
    from pendmap.model import Rig
    from pendmap.model.effects import Effect

__all__ = ["METHOD", "fit_decay", "identification_of", "identify"]

METHOD: Final = "trajectory"
TOO_GOOD: Final = 0.7
"""A sum of squares below this part of its degrees of freedom shows that sigma is too large."""


def identify(  # noqa: PLR0913 (the record, and what is known of it)
    time: NDArray[np.float64],
    theta: NDArray[np.float64],
    *,
    sigma: float | None = None,
    trusted: NDArray[np.bool_] | None = None,
    start: Rig | Mapping[str, float] | None = None,
    offset: bool = True,
    friction: bool = True,
    effects: Sequence[Effect] = (),
    free: Sequence[str] | None = None,
) -> Identification:
    """Return the damping found in a free decay by fitting its whole trajectory.

    Parameters
    ----------
    time : ndarray of float, shape (n,)
        In s; each after the one before it.
    theta : ndarray of float, shape (n,)
        Readings of the angle from the downward rest, rad, unwrapped.
    sigma : float, optional
        Their standard error, rad; if none is given, the noise of the record as it is seen without
        any model.
    trusted : ndarray of bool, shape (n,), optional
        Which samples count; all if none are given.
    start : Rig or mapping of str to float, optional
        Where the search starts; else from zero crossings and the energy of each half swing.
    offset : bool
        Whether the sensor may read zero at another angle; ``offset`` is what it reads at rest
        there.
    friction : bool
        Whether there may be Coulomb friction.
    effects : sequence of Effect
        Whatever else acts, parameters in SI.
    free : sequence of str, optional
        Which of their parameters (``effect.parameter``) are fitted; if none are given, all but
        those that are shapes: exponents, orders and widths.

    Returns
    -------
    Identification
        ``w0``, ``c_over_m``, ``Tr``, ``offset`` and the effects' parameters. Damping may come out
        negative, which no pendulum has and a warning says: something else is missing then.

    Raises
    ------
    InputError
        If the arrays do not fit together.

    References
    ----------
    Bock (1983), Progress in Scientific Computing 2, 95, for the method; Venzon & Moolgavkar (1988),
    Applied Statistics 37, 87, for the intervals.
    """
    try:
        fit, reading = fit_decay(
            time,
            theta,
            sigma=sigma,
            trusted=trusted,
            start=start,
            offset=offset,
            friction=friction,
            effects=effects,
            free=free,
        )
    except TooShortError as error:
        return Identification(METHOD, warnings=(str(error),), applicable=False)
    return identification_of(fit, [reading], span(np.asarray(time)))


def identification_of(fit: TrajectoryFit, readings: Sequence[Reading], part: str) -> Identification:
    """Return a fit as every method gives its result.

    Parameters
    ----------
    fit : TrajectoryFit
        To one record or more.
    readings : sequence of Reading
        Of each record.
    part : str
        Which part of them, in words.
    """
    renamed = {f"{OFFSET}.d": "offset"}
    names = tuple(renamed.get(name, name) for name in fit.names)
    # Where the model does not fit, the noise is not what the errors come from.
    wider = math.sqrt(fit.widening)
    found = [
        dataclasses.replace(e, stderr=None if e.stderr is None else wider * e.stderr)
        for e in fit.estimates.values()
    ]
    estimates = dict(zip(names, found, strict=True))
    count, whole = len(fit.windows), len(readings)
    motions = "one motion" if whole == 1 else f"{whole} motions"
    how = f"as {motions}" if count == whole else f"in {count} windows"
    total = sum(len(reading.each) for reading in readings)
    units = {r.unit for r in readings}
    sigmas = [r.sigma * (r.gain if len(units) == 1 else 1.0) for r in readings]
    noise = " to ".join(f"{x:.2e}" for x in sorted({min(sigmas), max(sigmas)}))
    noise += f" {units.pop() if len(units) == 1 else 'rad'}"
    return Identification(
        METHOD,
        estimates=estimates,
        used=f"{fit.samples} readings of {total}, {part}, {how}; noise {noise}",
        warnings=tuple(_warnings(fit, estimates, readings)),
        covariance=(names, fit.widening * fit.covariance),
        misfit=fit.chi2 / max(fit.degrees, 1),
        model=fit.model,
        converged=fit.converged,
    )


def fit_decay(  # noqa: PLR0913 (the record, and what is known of it)
    time: NDArray[np.float64],
    theta: NDArray[np.float64],
    *,
    sigma: float | None = None,
    trusted: NDArray[np.bool_] | None = None,
    start: Rig | Mapping[str, float] | None = None,
    offset: bool = True,
    friction: bool = True,
    effects: Sequence[Effect] = (),
    free: Sequence[str] | None = None,
) -> tuple[TrajectoryFit, Reading]:
    """Return the fit behind :func:`identify`, with curve and residuals, and the standard errors.

    Parameters and errors are those of :func:`identify`.

    Raises
    ------
    TooShortError
        If the record gives no start and none is given.
    """
    time, theta = (np.ascontiguousarray(a, dtype=np.float64) for a in (time, theta))
    if time.shape != theta.shape or time.ndim != 1:
        raise InputError(
            f"time has {time.shape} values and theta {theta.shape}: they must be as many"
        )
    if not (np.all(np.isfinite(time)) and np.all(np.isfinite(theta))):
        raise InputError("time and theta must be finite numbers, one is not")
    if sigma is not None and checks.number("sigma", sigma) <= 0:
        raise InputError(f"sigma must be a number above 0, got {sigma:g}")
    good = np.ones(time.shape, bool) if trusted is None else np.asarray(trusted, bool)
    if good.shape != time.shape:
        raise InputError("trusted and time differ in length: they must be as many")
    elapsed, first = from_first(time)
    reading = reading_of(elapsed, theta, sigma, trusted=good)
    run = FitRun(
        elapsed,
        theta - reading.shift,
        reading.each,
        trusted=good,
        lab_time_s=first,
        count=reading.interval,
    )
    found, (reading,) = fit_from_start(
        [run],
        [reading],
        start=start,
        offset=offset,
        friction=friction,
        effects=effects,
        free=free,
    )
    return found, reading


def _warnings(
    fit: TrajectoryFit, estimates: Mapping[str, Estimate], readings: Sequence[Reading]
) -> list[str]:
    found = []
    opposing = [
        f"{e.name}.{size}" for e in fit.model.effects if opposes(e.definition) for size in e.sizes
    ]
    for name in ("c_over_m", "Tr", *opposing):
        if name in estimates and estimates[name].value < 0:
            low, high = estimates[name].ci95 or (-math.inf, math.inf)
            found.append(
                f"{name} is {estimates[name].value:.3g}, which no pendulum has: "
                + (
                    "its interval reaches 0"
                    if low <= 0 <= high
                    else "an effect is missing in the model"
                )
            )
    ratio = fit.chi2 / max(fit.degrees, 1)
    if fit.widening > 1:
        found.append(
            f"the model does not fit: residuals are {math.sqrt(ratio):.2g} times the noise, and "
            "the errors are widened by that factor; an effect is missing in the model"
        )
    elif ratio < TOO_GOOD and not any(reading.coarse for reading in readings):
        found.append(f"residuals are {math.sqrt(ratio):.2g} times sigma: sigma is too large")
    if not fit.converged:
        found.append("the search did not converge")
    # How a sensor leans shows in wide swings alone: nobody asks for it.
    wanted = {name: e for name, e in estimates.items() if name.partition("[")[0] not in SENSOR}
    lost = [name for name, e in wanted.items() if e.ci95 is None]
    if lost:
        found.append(f"no end was found for the interval of {', '.join(lost)}")
    laws = [reading.law for reading in readings if reading.law]
    found += [f"{law}: each reading counts by the noise at its {law.grows_with}" for law in laws]
    coarse = [f"{r.gain * r.count:.3g} {r.unit}" for r in readings if r.coarse]
    if coarse:
        found.append(
            f"the sensor's count ({', '.join(dict.fromkeys(coarse))}) is coarser than its noise: "
            "readings are taken for intervals"
        )
    return found
