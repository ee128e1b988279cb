"""The largest Lyapunov exponent of the attractor that a start reaches."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis.orbit_table import table
from pendmap.analysis.summary import of_model
from pendmap.errors import (
    MOST_PERIODS,
    MOST_SEED,
    MOST_THREADS,
    InputError,
    check_callable,
    check_number,
    check_whole,
    core_errors,
)
from pendmap.files.dataset import FORMAT_VERSION
from pendmap.formatting import counted
from pendmap.model import without_dimensions
from pendmap.units import RATE, TIME, VELOCITY, Units

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pendmap.model import Pendulum, Rig

    Floats = NDArray[np.float64]


_CLEAR = 3.0
"""Without damping an exponent below so many times that of deviations growing as tau is that of
regular motion, and the spread of trajectories no error of it."""

_MOST_PRECISION = 0.5
"""A standard error of half the exponent says its sign, and little else."""


def lyapunov(  # noqa: PLR0913 (physics first, numerical choices by name)
    pendulum: Pendulum | Rig,
    theta: float = 1.0,
    velocity: float = 0.0,
    *,
    precision: float = 1e-3,
    tol: float = 1e-6,
    max_periods: int | None = None,
    threads: int | None = None,
    seed: int = 0,
    progress: Callable[[int, int], object] | None = None,
) -> xr.Dataset:
    """Largest Lyapunov exponent of the attractor that a start reaches.

    ``lambda = lim ln(|dx(tau)| / |dx(0)|) / tau``, ``dx`` a small deviation. The start is followed
    until an attractor has captured it. Of a closed orbit the exponent is exact, from the
    multipliers of ``P^n``: ``ln |mu| / (n T)``. Of chaos it is the mean over 256 trajectories on
    the attractor, the first periods of each dropped, with the standard error of their spread; they
    go on until that is ``precision`` times the exponent. A trajectory that is chaotic for long and
    then captured has the exponent of what captured it: ``transient_periods`` says when.

    Friction: a turn multiplies the deviation's velocity by the ratio of the accelerations after and
    before it; a stick takes its velocity away and leaves its angle. So a motion that sticks keeps a
    finite largest exponent, and its second one is minus infinity. What is held for ever has none:
    deviations neither grow nor shrink.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; with a rig velocities are in rad/s and exponents per second.
    theta, velocity : float
        Where the start is at ``tau = 0``: angle in rad, velocity ``d theta / d tau``.
    precision : float
        Standard error over exponent that chaos is averaged for; above 0, up to 0.5.
    tol : float
        As for :func:`pendmap.basins`.
    max_periods : int, optional
        Periods within which an attractor must capture the start, by default as for
        :func:`pendmap.basins`, and that each trajectory of an ensemble is followed for at the most,
        20,000 (without damping 2000).
    threads : int, optional
        Number of threads; by default one a processor. The result does not depend on it.
    seed : int
        Chooses the trajectories on a chaotic attractor.
    progress : callable, optional
        Called now and then with what is done and in all.

    Returns
    -------
    xarray.Dataset
        ``growth`` over ``elapsed`` periods: the logarithm of the growth of a deviation along the
        start's own trajectory. Of chaos ``running_exponent`` and ``running_stderr`` over
        ``averaged``, the periods that each trajectory has been averaged for, and
        ``finite_time_exponent`` over ``trajectory`` and ``window``. The attractor with its points,
        as of :func:`pendmap.basins`. Attributes ``exponent``, ``stderr`` (0 where the exponent is
        exact, nan for regular motion without damping), ``regular`` (what such
        motion has over the same time), ``per_period``, ``end``
        (``captured``, ``chaotic``, ``undamped``, ``undecided`` or ``failed``),
        ``transient_periods``, ``second_exponent`` and
        ``kaplan_yorke_dimension`` (of the stroboscopic map's attractor, ``1 + lambda_1 /
        |lambda_2|``); nan where one has no meaning.

    Raises
    ------
    InputError
        If a value is outside its range, or the model has an effect that no map can have.
    KeyboardInterrupt
        After Ctrl-C, within a fraction of a second.

    References
    ----------
    Benettin, Galgani, Giorgilli & Strelcyn (1980), Meccanica 15, 9 and 21 (the method); Kaplan &
    Yorke (1979), Lecture Notes in Mathematics 730, 204; Mueller (1995), Chaos, Solitons & Fractals
    5, 1671 (turns and sticks).
    """
    model = pendulum
    pendulum, units = without_dimensions(model)
    theta, velocity = check_number("theta", theta), check_number("velocity", velocity)
    precision = check_number("precision", precision)
    if not 0 < precision <= _MOST_PRECISION:
        raise InputError(
            f"precision must be a number above 0, up to {_MOST_PRECISION}, got {precision:g}"
        )
    check_callable("progress", progress)
    choices: _core._ExponentChoices = {
        "precision": precision,
        "tol": check_number("tol", tol),
        "max_periods": None
        if max_periods is None
        else check_whole("max_periods", max_periods, 1, MOST_PERIODS),
        "threads": 0 if threads is None else check_whole("threads", threads, 1, MOST_THREADS),
        "seed": check_whole("seed", seed, 0, MOST_SEED),
    }
    began = time.perf_counter()
    with core_errors():
        start = theta, units.bare(velocity, VELOCITY)
        raw = _core.lyapunov(pendulum, start, choices, progress)
    found = raw["attractor"]
    exponent, stderr = _value(raw)
    regular = _regular(raw, pendulum.period)
    if exponent < _CLEAR * regular:
        stderr = math.nan
    if found is not None and raw["end"] == "chaotic":
        found = found | {"exponent": exponent, "exponent_stderr": stderr}
    attractors = [] if found is None else [found | {"twin": None}]
    dataset = xr.Dataset(
        {
            **table(attractors, units, "attractor"),
            **_course(raw),
            **_ensemble(raw, pendulum.period, units),
        },
        coords={"attractor": ("attractor", np.array([a["name"] for a in attractors], dtype=str))},
    )
    dataset.attrs = {
        "kind": "lyapunov",
        "title": model.title,
        **model.attributes,
        "section": model.units.section,
        "forcing_period": units.given(pendulum.period, TIME),
        "theta0": theta,
        "velocity0": velocity,
        "exponent": units.given(exponent, RATE),
        "stderr": units.given(stderr, RATE),
        "regular": units.given(regular, RATE),
        "per_period": exponent * pendulum.period,
        "per_period_stderr": stderr * pendulum.period,
        **_second(raw, exponent, pendulum, units),
        "end": raw["end"],
        "transient_periods": -1 if raw["transient"] is None else raw["transient"],
        "trajectories": 0 if raw["growth"] is None else raw["growth"].shape[0],
        "window": raw["window"],
        "periods": 0 if raw["growth"] is None else raw["growth"].shape[1] * raw["window"],
        "dropped_periods": raw["dropped"] or 0,
        "lost": raw["lost"],
        "precision": precision,
        "tol": choices["tol"],
        "reached_error": raw["reached_error"],
        "steps_per_period": raw["steps_per_period"],
        "max_periods": raw["bound"],
        "chaos_bound": raw["chaos_bound"],
        "seconds": time.perf_counter() - began,
        "simd": raw["simd"],
        "threads": choices["threads"] or _core.default_threads(),
        "seed": choices["seed"],
        "pendmap_version": _core.__version__,
        "format_version": FORMAT_VERSION,
    }
    lines = [*summary(dataset), *of_model(model, "this exponent is")]
    dataset.attrs["summary"] = "\n".join(lines)
    return dataset


def _value(raw: dict[str, Any]) -> tuple[float, float]:
    """The exponent per unit of tau and its standard error; nan where there is none."""
    if raw["end"] in {"chaotic", "undamped"}:
        exponent, stderr = raw["exponent"]
        return float(exponent), float(stderr)
    if raw["end"] == "captured":
        own = raw["attractor"]
        return float(own["exponent"]), float(own["exponent_stderr"])
    return math.nan, math.nan


def _regular(raw: dict[str, Any], period: float) -> float:
    """The exponent of regular motion over the same periods: deviations grow as tau; else nan."""
    if raw["end"] != "undamped":
        return math.nan
    averaged = float(raw["growth"].shape[1] * raw["window"])
    return math.log1p(averaged / raw["dropped"]) / (averaged * period)


def _second(
    raw: dict[str, Any], exponent: float, pendulum: Pendulum, units: Units
) -> dict[str, Any]:
    """The other exponent, the sum of both, the dimension that they give."""
    own = raw["attractor"]
    if raw["end"] in {"chaotic", "undamped"}:
        total, error = raw["sum"]
        total += 0.0  # no minus zero
        second, dimension = total - exponent, math.nan
        if raw["end"] == "chaotic" and second < 0 < exponent:
            dimension = 1 + exponent / abs(second)
    elif own is not None and len(own["multipliers"]) > 1:
        sizes = [math.hypot(*pair) for pair in own["multipliers"]]
        period, error = own["n"] * pendulum.period, 0.0
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


def _course(raw: dict[str, Any]) -> dict[str, Any]:
    growth = np.concatenate([[0.0], np.cumsum(raw["course"])])
    text = "logarithm of the growth of a deviation along the start's own trajectory"
    return {
        "growth": ("elapsed", growth, {"units": "1", "long_name": text}),
        "elapsed": (
            "elapsed",
            np.arange(growth.size, dtype=np.int32),
            {"long_name": "periods since the start"},
        ),
    }


def _ensemble(raw: dict[str, Any], period: float, units: Units) -> dict[str, Any]:
    """The running mean over all trajectories, and the exponents of all windows."""
    growth = np.empty((0, 0)) if raw["growth"] is None else raw["growth"]
    count, windows = growth.shape
    time = raw["window"] * period
    averaged = np.arange(1, windows + 1)
    means: Floats = np.cumsum(growth, axis=1) / (averaged * time)
    deviation = means.std(axis=0, ddof=1) if count > 1 else np.zeros(windows)
    mean = means.mean(axis=0) if count else np.zeros(windows)
    rate = {"units": units.of_rate}
    return {
        "finite_time_exponent": (
            ("trajectory", "window"),
            units.given(growth / time, RATE),
            rate | {"long_name": f"finite-time exponent over {raw['window']} periods"},
        ),
        "running_exponent": ("window", units.given(mean, RATE), rate),
        "running_stderr": ("window", units.given(deviation / math.sqrt(max(count, 1)), RATE), rate),
        "averaged": (
            "window",
            (averaged * raw["window"]).astype(np.int32),
            {"long_name": "periods that each trajectory has been averaged for"},
        ),
    }


# What a Lyapunov exponent says of itself.


_BY_ROUNDING = math.log(1e10)
"""A deviation of rounding that grows by so much is seen in the result."""


def summary(dataset: xr.Dataset) -> list[str]:
    """Return the lines about an exponent."""
    a, units = dataset.attrs, Units.of(dataset.attrs)
    name = str(dataset["attractor"].values[0]) if dataset.sizes["attractor"] else ""
    lines = [*_ended(dataset, name)]
    value, per = a["exponent"], units.per_time
    if math.isfinite(value) and a["end"] in {"chaotic", "undamped"}:
        known = math.isfinite(a["stderr"])
        each, whole = (
            f" +- {a[key]:.2g}" if known else "" for key in ("stderr", "per_period_stderr")
        )
        lines.append(
            f"Largest Lyapunov exponent {value:.6g}{each} {per}, "
            f"{a['per_period']:.6g}{whole} per period: mean over "
            f"{a['trajectories']} trajectories of "
            f"{counted(a['periods'], 'period')} each, {a['dropped_periods']} more dropped before."
        )
        if not known:
            lines.append(
                f"Deviations that grow as tau, those of regular motion, give {a['regular']:.2g} "
                f"{per} over so long: it cannot be told from 0."
            )
        if value > 0 and a["end"] == "chaotic":
            lines.append(
                f"A deviation doubles in {math.log(2) / a['per_period']:.3g} periods on average."
            )
        aim = a["precision"] * abs(value)
        if a["end"] == "chaotic" and a["stderr"] > aim:
            lines.append(f"THE PRECISION {a['precision']:g} WAS NOT REACHED: raise --max-periods.")
    elif math.isfinite(value):
        exact = "exact, from the multipliers" if len(_pairs(dataset)) else "exactly"
        lines.append(
            f"Largest Lyapunov exponent {value:.9g} {per}, {a['per_period']:.9g} per period: "
            f"{exact}."
        )
    if not (math.isfinite(value) and math.isnan(a["stderr"])):
        lines += _other(a, units)
    lines.append(
        f"{counted(a['steps_per_period'], 'step')} a period, error reached "
        f"{a['reached_error']:.1e}, {a['seconds']:.2f} s on {counted(a['threads'], 'thread')} "
        f"({a['simd']})."
    )
    return lines


def _pairs(dataset: xr.Dataset) -> list[Any]:
    if not dataset.sizes["attractor"]:
        return []
    return [pair for pair in dataset["multipliers"].values[0] if pair[0] == pair[0]]


def _ended(dataset: xr.Dataset, name: str) -> list[str]:
    """What became of the start."""
    a, units = dataset.attrs, Units.of(dataset.attrs)
    speed = units.spoken(format(a["velocity0"], "g"))
    start = f"From theta = {a['theta0']:g} rad, velocity = {speed}"
    if a["end"] == "captured":
        said = f"{start}: {name}, reached after {counted(a['transient_periods'], 'period')}."
        grown = float(dataset["growth"].values[: a["transient_periods"] + 1].max())
        if grown > _BY_ROUNDING:
            said += (
                f" On the way deviations grow by 1e{grown / math.log(10):.0f}: rounding decides "
                "when it is reached, and which one where others coexist."
            )
        if a["exponent"] == -math.inf:
            said += " Its exponent is minus infinity: both multipliers are 0."
        elif math.isnan(a["exponent"]):
            said += " Friction holds it for ever: deviations neither grow nor shrink, and it has"
            said += " no exponent."
    else:
        words = {
            "chaotic": f": {name}; none of the trajectories watched was captured by anything"
            f" within {a['chaos_bound']} periods, none of these here at their ends.",
            "undamped": ". Without damping there are no attractors: this is the exponent of the"
            " motion near this start.",
            "undecided": f": undecided within {counted(a['max_periods'], 'period')}; no exponent"
            " is given, since a chaotic transient has a positive one too. --max-periods raises"
            " this bound.",
            "failed": ": leaves the range of numbers; there is no exponent.",
        }
        said = start + words[a["end"]]
    if not a["lost"]:
        return [said]
    lost = f"{a['lost']} of {a['trajectories']} trajectories"
    return [
        said,
        f"What looks chaotic is a transient: {lost} settled. lifetime says how long it lasts.",
    ]


def _other(a: dict[str, Any], units: Units) -> list[str]:
    second, dimension = a["second_exponent"], a["kaplan_yorke_dimension"]
    if second == -math.inf:
        also = f", Kaplan-Yorke dimension {dimension:g}" if math.isfinite(dimension) else ""
        return [f"Friction stops the motion: the second exponent is minus infinity{also}."]
    if not math.isfinite(second):
        return []
    error = a["exponent_sum_stderr"]
    total = f"{a['exponent_sum']:.6g}" + (f" +- {error:.2g}" if error else "")
    line = f"Second exponent {second:.6g} {units.per_time}, sum of both {total}"
    if dimension > 0:
        line += f"; Kaplan-Yorke dimension {dimension:.4f} of the stroboscopic map's attractor"
    return [line + "."]
