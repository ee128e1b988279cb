"""The largest Lyapunov exponent of the attractor that a start reaches."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import orbit_table, result
from pendmap.analysis.result import Field, Found, Schema, none_below_0, summarised
from pendmap.analysis.run import Numerics, RunOptions
from pendmap.analysis.summary import effort
from pendmap.errors import InputError, check_number, core_errors
from pendmap.files import facts
from pendmap.files.variables import variable
from pendmap.formatting import counted, with_error
from pendmap.model import without_dimensions
from pendmap.units import RATE, TIME, VELOCITY, Units

if TYPE_CHECKING:
    from pendmap.analysis.run import Keywords
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats


_CLEAR = 3.0
"""Without damping, motion is regular if its exponent is below this multiple of that of deviations
that grow as tau; the spread of trajectories is then no standard error."""
_MOST_PRECISION = 0.5  # Largest relative standard error, at which the exponent's sign is certain
_BY_ROUNDING = math.log(1e10)  # Growth of deviations from which rounding determines the result


SCHEMA = Schema(
    "lyapunov",
    result.UNITS,
    Found("exponent", result.OF_RATE, "largest Lyapunov exponent", variable="largest_exponent"),
    Found("stderr", result.OF_RATE, "its error; 0: exact", variable="largest_exponent_stderr"),
    Found("per_period", "1/period", "the exponent per forcing period"),
    Found("per_period_stderr", "1/period", "its standard error"),
    Found("second_exponent", result.OF_RATE, "the other exponent"),
    Found("exponent_sum", result.OF_RATE, "sum of both exponents"),
    Found("kaplan_yorke_dimension", "1", "dimension of the stroboscopic map's attractor"),
    Found("end", "", "captured, chaotic, undamped, undecided or failed"),
    Field(
        *("attractor", "", "the attractor that was reached"),
        read=lambda d: next(iter(orbit_table.objects(d, "attractor")), None),
    ),
    Found("transient_periods", "periods", "time of capture; -1: none", convert=none_below_0),
    Field("trajectories", "1", "trajectories of the ensemble"),
    Field("periods", "periods", "length of each of them"),
    Field("dropped_periods", "periods", "periods of each dropped before"),
    Found("lost", "1", "trajectories that settled elsewhere"),
    Field("precision", "1", "relative standard error that was asked for"),
    result.TOL,
    result.REACHED,
    result.STEPS,
    result.BOUND,
    result.CHAOS_BOUND,
    *result.RUN,
    *result.END,
    result.SECTION,
    Field("forcing_period", result.OF_TIME, "forcing period", json=False),
    Field("theta0", "rad", "angle at the start", json=False),
    Field("velocity0", result.OF_VELOCITY, "velocity at the start", json=False),
    Found("regular", result.OF_RATE, "exponent of regular motion over this time", json=False),
    Found("exponent_sum_stderr", result.OF_RATE, "standard error of the sum", json=False),
    Field("window", "periods", "length of a window of finite_time_exponent", json=False),
    references="Benettin, Galgani, Giorgilli & Strelcyn (1980), Meccanica 15, 9 and 21",
)


def lyapunov(  # noqa: PLR0913 (physics first, numerical choices by name)
    pendulum: Pendulum | Rig,
    theta: float = 1.0,
    velocity: float = 0.0,
    *,
    precision: float = 1e-3,
    tol: float = 1e-6,
    max_periods: int | None = None,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> xr.Dataset:
    """Compute the largest Lyapunov exponent of the attractor that a start reaches.

    ``lambda = lim ln(|dx(tau)| / |dx(0)|) / tau``, ``dx`` a small deviation. The start is followed
    until an attractor has captured it. For a closed orbit the exponent is exact, from the
    multipliers of ``P^n``: ``ln |mu| / (n T)``. For chaos it is the mean over 256 trajectories on
    the attractor, the first periods of each dropped, with the standard error of their spread; they
    continue until that is ``precision`` times the exponent. A long chaotic transient has the
    exponent of the attractor that captures it; ``transient_periods`` is the time of capture.

    With friction, a turning point multiplies the deviation's velocity by the ratio of the
    accelerations after and before it; sticking sets its velocity to 0, and the second exponent is
    minus infinity. A pendulum that friction holds permanently has no exponent.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; with a rig velocities are in rad/s and exponents per second.
    theta : float
        Angle at the start, rad.
    velocity : float
        Velocity at the start, ``d theta / d tau``; with a rig ``d theta / d t``.
    precision : float
        Ratio of standard error to exponent at which averaging of chaos ends; above 0, up to 0.5.
    max_periods : int, optional
        Periods within which an attractor must capture the start, by default 4000, more where
        damping is small, and for which an ensemble is followed, 20,000 (without damping 2000).
    tol, run
        As for :func:`pendmap.basins`.

    Returns
    -------
    xarray.Dataset
        ``growth`` over ``elapsed`` periods: the logarithm of the growth of a deviation along the
        start's own trajectory. Of chaos ``running_exponent`` and ``running_stderr`` over
        ``averaged``, the periods that each trajectory has been averaged for, and
        ``finite_time_exponent`` over ``trajectory`` and ``window``. The attractor with its points,
        as for :func:`pendmap.basins`. Without dimensions ``largest_exponent``,
        ``largest_exponent_stderr`` (0 where the exponent is exact, nan for regular motion without
        damping), ``regular`` (the exponent of such motion over the same time), ``per_period``,
        ``end`` (``captured``, ``chaotic``, ``undamped``, ``undecided`` or ``failed``),
        ``transient_periods``, ``second_exponent`` and ``kaplan_yorke_dimension`` (of the
        stroboscopic map's attractor, ``1 + lambda_1 / |lambda_2|``); nan where one has no
        meaning.

    Raises
    ------
    InputError
        If a value is outside its range, or the model has an effect that no map can have.

    References
    ----------
    Benettin, Galgani, Giorgilli & Strelcyn (1980), Meccanica 15, 9 and 21 (the method); Kaplan &
    Yorke (1979), Lecture Notes in Mathematics 730, 204; Mueller (1995), Chaos, Solitons & Fractals
    5, 1671 (turns and sticks).

    Examples
    --------
    >>> import pendmap
    >>> pendulum = pendmap.Pendulum(gamma=0.1, p=2.0, omega=2.0)
    >>> result = pendmap.lyapunov(pendulum)
    >>> round(float(result["largest_exponent"]), 1)
    0.3
    """
    bare, units = without_dimensions(pendulum)
    theta, velocity = check_number("theta", theta), check_number("velocity", velocity)
    precision = check_number("precision", precision)
    if not 0 < precision <= _MOST_PRECISION:
        raise InputError(
            f"precision must be a number above 0, up to {_MOST_PRECISION}, got {precision:g}"
        )
    run = RunOptions.of(run, options).in_memory("lyapunov")
    numerics = Numerics(run, tol, max_periods)
    choices: _core._ExponentChoices = {"precision": precision, **numerics.core}
    with core_errors():
        start = theta, units.bare(velocity, VELOCITY)
        raw = _core.lyapunov(bare, start, choices, run.progress)
    attractor, members = raw.attractor, raw.ensemble
    growth = np.empty((0, 0)) if members is None else members.growth
    exponent, stderr, regular = _value(raw, bare.period)
    dataset = xr.Dataset(
        {
            **orbit_table.table([] if attractor is None else [attractor], units, "attractor"),
            **_growth(raw, growth, bare.period, units),
        }
    )
    values = {
        **numerics.provenance(),
        **_second(raw, exponent, bare, units),
        "forcing_period": units.given(bare.period, TIME),
        "theta0": theta,
        "velocity0": velocity,
        "exponent": units.given(exponent, RATE),
        "stderr": units.given(stderr, RATE),
        "regular": units.given(regular, RATE),
        "per_period": exponent * bare.period,
        "per_period_stderr": stderr * bare.period,
        "transient_periods": -1 if raw.transient is None else raw.transient,
        "trajectories": growth.shape[0],
        "periods": growth.shape[1] * raw.window,
        "dropped_periods": 0 if members is None else members.dropped,
        "precision": precision,
    }
    SCHEMA.complete(dataset, pendulum, values, raw)
    summarised(dataset, _summary(dataset), pendulum, "this exponent is")
    return dataset


def _value(raw: _core.Lyapunov, period: float) -> tuple[float, float, float]:
    """Return the exponent per tau, its error, and that of deviations that grow as tau; or nan."""
    if raw.attractor is not None:
        return raw.attractor.exponent, raw.attractor.exponent_stderr, math.nan
    if raw.ensemble is None or raw.end != "undamped":
        return math.nan, math.nan, math.nan
    averaged = float(raw.ensemble.growth.shape[1] * raw.window)
    regular = math.log1p(averaged / raw.ensemble.dropped) / (averaged * period)
    exponent, stderr = raw.ensemble.exponent
    return exponent, math.nan if exponent < _CLEAR * regular else stderr, regular


def _second(
    raw: _core.Lyapunov, exponent: float, pendulum: Pendulum, units: Units
) -> dict[str, Any]:
    """Return the second exponent, the sum of both, and the Kaplan-Yorke dimension."""
    attractor = raw.attractor
    if raw.ensemble is not None and raw.end in {"chaotic", "undamped"}:
        total, error = raw.ensemble.sum
        total += 0.0  # no minus zero
        second, dimension = total - exponent, math.nan
        if raw.end == "chaotic" and second < 0 < exponent:
            dimension = 1 + exponent / abs(second)
    elif attractor is not None and attractor.n is not None and len(attractor.multipliers) > 1:
        sizes = [math.hypot(*pair) for pair in attractor.multipliers]
        period, error = attractor.n * pendulum.period, 0.0
        second = math.log(sizes[1]) / period if sizes[1] else -math.inf
        total, dimension = exponent + second, 0.0
    else:
        second = total = error = dimension = math.nan
    return {
        "second_exponent": units.given(second, RATE),
        "exponent_sum": units.given(total, RATE),
        "exponent_sum_stderr": units.given(error, RATE),
        "kaplan_yorke_dimension": dimension,
    }


def _growth(raw: _core.Lyapunov, growth: Floats, period: float, units: Units) -> dict[str, Any]:
    """Return the growth along the start's trajectory, running means, finite-time exponents."""
    course = np.concatenate([[0.0], np.cumsum(raw.course)])
    count, windows = growth.shape
    time = raw.window * period
    averaged = np.arange(1, windows + 1)
    means: Floats = np.cumsum(growth, axis=1) / (averaged * time)
    mean, stderr = np.zeros(windows), np.zeros(windows)
    if windows:
        mean, stderr = means.mean(axis=0), means.std(axis=0, ddof=1) / math.sqrt(count)
    elapsed = np.arange(course.size, dtype=np.int32)
    periods = (averaged * raw.window).astype(np.int32)
    rate, lasting = units.of_rate, "time that each trajectory has been averaged for"
    local, finite = units.given(growth / time, RATE), f"exponent over {raw.window} periods"
    running = "mean exponent of the trajectories up to this time"
    error = "standard error of the mean exponent"
    text = "logarithm of the growth of a deviation along the start's own trajectory"
    return {
        "growth": variable("elapsed", course, "1", text),
        "elapsed": variable("elapsed", elapsed, "periods", "time since the start"),
        "finite_time_exponent": variable(("trajectory", "window"), local, rate, finite),
        "running_exponent": variable("window", units.given(mean, RATE), rate, running),
        "running_stderr": variable("window", units.given(stderr, RATE), rate, error),
        "averaged": variable("window", periods, "periods", lasting),
    }


def _summary(dataset: xr.Dataset) -> list[str]:
    a = facts(dataset)
    units, end, value = Units.of(a), a["end"], a["largest_exponent"]
    speed = units.spoken(format(a["velocity0"], "g"))
    name = str(dataset["attractor"].values[0]) if dataset.sizes["attractor"] else ""
    how = {
        "captured": f"{name}, reached after {counted(a['transient_periods'], 'period')}",
        "chaotic": f"{name}; none of the trajectories of the search was captured within "
        f"{a['chaos_bound']} periods, and none of those followed here had settled at its end",
        "undamped": "without damping there are no attractors; motion near this start",
        "undecided": f"undecided within {counted(a['max_periods'], 'period')}; no exponent is "
        "given, since a chaotic transient has a positive one too. --max-periods raises this bound",
        "failed": "the motion leaves the range of numbers; there is no exponent",
    }
    lines = [f"From theta = {a['theta0']:g} rad, velocity = {speed}: {how[end]}."]
    grown = float(dataset["growth"].values[: max(a["transient_periods"], 0) + 1].max())
    if end == "captured" and grown > _BY_ROUNDING:
        lines.append(
            f"On the way deviations grow by 1e{grown / math.log(10):.0f}: rounding decides when it "
            "is reached, and which one where others coexist."
        )
    if a["lost"]:
        lines.append(
            f"The chaos is a transient: {a['lost']} of {a['trajectories']} trajectories settled. "
            "The analysis lifetime estimates its duration."
        )
    if end == "captured" and math.isnan(value):
        lines.append("Friction holds it permanently: there is no exponent.")
    if math.isfinite(value):
        rate = f"{with_error(value, a['largest_exponent_stderr'])} {units.per_time}"
        whole = f"{with_error(a['per_period'], a['per_period_stderr'])} per period"
        of = f": mean over {a['trajectories']} trajectories of {counted(a['periods'], 'period')}"
        of += f" each, {a['dropped_periods']} more dropped before"
        lines.append(
            f"Largest Lyapunov exponent {rate}, {whole}{of if a['trajectories'] else ', exact'}."
        )
    if end == "chaotic" and value > 0:
        doubling = math.log(2) / a["per_period"]
        lines.append(f"A deviation doubles in {doubling:.3g} periods on average.")
        if a["largest_exponent_stderr"] > a["precision"] * value:
            lines.append(f"THE PRECISION {a['precision']:g} WAS NOT REACHED: raise --max-periods.")
    if math.isfinite(value) and math.isnan(a["largest_exponent_stderr"]):
        lines.append(
            f"Deviations of regular motion, which grow as tau, give {a['regular']:.2g} over this "
            "time: the exponent is not significantly different from 0."
        )
    elif not math.isnan(a["second_exponent"]):
        total = with_error(a["exponent_sum"], a["exponent_sum_stderr"])
        line = f"Second exponent {a['second_exponent']:.6g} {units.per_time}, sum of both {total}"
        dimension = a["kaplan_yorke_dimension"]
        lines.append(
            line + (f"; Kaplan-Yorke dimension {dimension:.4f}." if dimension > 0 else ".")
        )
    return [*lines, effort(a)]
