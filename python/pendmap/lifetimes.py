"""Transient chaos: how long it lives before an attractor captures it."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr

from pendmap import _core, checks, survival
from pendmap.errors import InputError
from pendmap.grid import starts as checked
from pendmap.maps import basins_of
from pendmap.model import without_dimensions
from pendmap.model.units import RATE, TIME, VELOCITY, Units
from pendmap.store import FORMAT_VERSION
from pendmap.summary import of_motion
from pendmap.words import counted

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from pendmap.model import Pendulum, Rig

    Floats = NDArray[np.float64]

__all__ = ["lifetime"]

_STARTS: Final = 40_000
_FASTEST: Final = 3.0
"""The window of starts, as of ``basins``."""

_MOST_STARTS: Final = 10_000_000
_FOLLOWED: Final = 400
"""Trajectories whose deviations are followed, and ..."""
_LONGEST: Final = 400
"""... for so many periods at the most."""
_LEAST_FOLLOWED: Final = 20
_SETTLING: Final = 4.0
"""A trajectory comes nearer to an attractor by this power of e before it counts as captured."""
_LEAST_SETTLING, _MOST_SETTLING = 10, 500
_ALIGNED: Final = 5
"""Periods in which a deviation turns into the direction of growth."""
_SURE: Final = 3.0
"""Standard errors by which the exponent must exceed the rate of escape."""
_DRAWN: Final = 4000
"""Periods of a survival curve that are kept."""


def lifetime(  # noqa: PLR0913 (physics first, numerical choices by name)
    pendulum: Pendulum | Rig,
    theta: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    *,
    starts: int = _STARTS,
    from_period: int | None = None,
    max_periods: int | None = None,
    tol: float = 1e-6,
    threads: int | None = None,
    seed: int = 0,
    progress: Callable[[int, int], object] | None = None,
) -> xr.Dataset:
    """Mean lifetime of transient chaos: the exponential tail of the times until capture.

    Starts drawn from a window run until an attractor captures them. Chaos that does not last is a
    chaotic saddle: what is still on it after ``t`` periods decays as ``exp(-t / mean)``. The mean
    is the maximum of the likelihood, the sum of all times beyond ``from_period``, those cut off at
    the bound included, over the number of captures; its standard error is ``mean /
    sqrt(captured)``.

    An exponential tail alone is no chaos: starts near the edge of a smooth basin leave the saddle
    on it at a rate ``kappa`` too. There ``kappa`` is the saddle's own exponent ``lambda``; on a
    chaotic saddle deviations grow faster than trajectories leave, and ``lambda - kappa`` is its
    entropy (Kantz & Grassberger 1985). So growth is measured along trajectories while they live,
    and where ``lambda`` does not exceed ``kappa`` there is no transient chaos, and no lifetime.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; with a rig velocities are in rad/s.
    theta, velocity : array_like, shape (N,), optional
        Starts at ``tau = 0``; by default drawn at random from [-pi, pi] x [-3, 3], with a rig from
        [-pi, pi] x [-3 w0, 3 w0].
    starts : int
        How many are drawn; 100 to ten million.
    from_period : int, optional
        Where the tail begins. By default where the data say so: twice the earliest period from
        which two tests (of a Weibull shape, and of a rate that changes) find it exponential.
    max_periods : int, optional
        The bound after which a start is given up, as for :func:`pendmap.basins`: 4000.
    tol : float
        As for :func:`pendmap.basins`.
    threads : int, optional
        Number of threads; by default one a processor. The result does not depend on it.
    seed : int
        Draws the starts.
    progress : callable, optional
        Called now and then with what is done and in all.

    Returns
    -------
    xarray.Dataset
        ``captured`` over ``attractor`` and ``elapsed``: the number that each attractor has captured
        within so many periods. ``tail_mean`` and ``tail_stderr`` over ``tail_begin``, what the mean
        would be from other beginnings. ``start_theta``, ``start_velocity``, ``capture_period`` (-1:
        never) and ``label`` over ``start``. Attributes ``mean_periods``, ``stderr``,
        ``from_period``, ``persistent`` (1 where nothing captured any trajectory and the exponent is
        positive), ``transient_chaos``, ``escape_rate`` and ``entropy`` per period, ``exponent`` on
        the saddle, ``saddle_dimension``; nan where one has no meaning.

    Raises
    ------
    InputError
        If a value is outside its range, or the model has an effect that no map can have.
    KeyboardInterrupt
        After Ctrl-C, within a fraction of a second.

    References
    ----------
    Kantz & Grassberger (1985), Physica D 17, 75; Lai & Tel (2011), Transient Chaos, chapter 2.
    """
    model = pendulum
    pendulum, units = without_dimensions(model)
    starts = checks.whole("starts", starts, survival.LEAST, _MOST_STARTS)
    if from_period is not None:
        from_period = checks.whole("from_period", from_period, 0, checks.MOST_PERIODS)
    seed = checks.whole("seed", seed, 0, checks.MOST_SEED)
    if (theta is None) != (velocity is None):
        raise InputError("theta and velocity: allowed is both or none of them")
    if theta is None or velocity is None:
        draw = np.random.default_rng(seed)
        reach = units.given(_FASTEST, VELOCITY)
        theta = draw.uniform(-math.pi, math.pi, starts)
        velocity = draw.uniform(-reach, reach, starts)
    angles, speeds = checked(theta, velocity)
    began = time.perf_counter()
    found = basins_of(
        model,
        angles,
        speeds,
        tol=tol,
        max_periods=max_periods,
        threads=threads,
        seed=seed,
        check=False,
        progress=progress,
    )
    label = found["label"].values.astype(np.int64)
    settle = found["settle_periods"].values.astype(np.int64)
    times = settle[settle >= 0]
    bound, censored = int(found.attrs["max_periods"]), int((label == 0).sum())
    fitted = None
    if times.size and found.attrs["plane"] == "basins":
        if from_period is None:
            fitted = survival.begin(times, censored, bound)
        elif from_period < bound:
            fitted = survival.tail(times, censored, bound, from_period)
            fitted = fitted if fitted.captured else None
    saddle = _saddle(found, fitted, pendulum, threads)
    dataset = xr.Dataset(
        {
            **{
                name: found[name]
                for name in found.data_vars
                if "attractor" in found[name].dims or "point" in found[name].dims
            },
            **_curves(found, times, censored, bound),
            "start_theta": found["start_theta"],
            "start_velocity": found["start_velocity"],
            "capture_period": ("start", settle.astype(np.int32), {"comment": "-1: never"}),
            "label": found["label"],
        },
        coords={"attractor": found["attractor"]},
    )
    dataset.attrs = {
        "kind": "lifetime",
        "title": model.title,
        **model.attributes,
        "section": model.units.section,
        **_attributes(found, fitted, saddle, pendulum, units),
        "starts": angles.size,
        "captured": int(times.size),
        "censored": censored,
        "failed": int((label < 0).sum()),
        "chaotic_share": _chaotic(found),
        "max_periods": bound,
        "chaos_bound": found.attrs["chaos_bound"],
        "from_period_given": int(from_period is not None),
        "tol": found.attrs["tol"],
        "reached_error": found.attrs["reached_error"],
        "steps_per_period": found.attrs["steps_per_period"],
        "seconds": time.perf_counter() - began,
        "simd": found.attrs["simd"],
        "threads": found.attrs["threads"],
        "seed": seed,
        "pendmap_version": _core.__version__,
        "format_version": FORMAT_VERSION,
    }
    lines = [*_summary(dataset, found), *of_motion(model.effects, "these lifetimes are")]
    dataset.attrs["summary"] = "\n".join(lines)
    return dataset


def _chaotic(found: xr.Dataset) -> float:
    """Share of the starts that end on a chaotic attractor."""
    chaos = np.array([str(kind).endswith("chaos") for kind in found["kind"].values], dtype=bool)
    return float(found["fraction"].values[chaos].sum())


def _curves(
    found: xr.Dataset, times: NDArray[np.int64], censored: int, bound: int
) -> dict[str, Any]:
    """Captures up to each period by each attractor; tails from all beginnings."""
    label, settle = found["label"].values, found["settle_periods"].values
    last = bound if censored else int(times.max(initial=0)) + 1
    elapsed = np.unique(np.linspace(0, last, min(last, _DRAWN) + 1).round().astype(np.int64))
    by = [
        np.searchsorted(np.sort(settle[(label == k) & (settle >= 0)]), elapsed, side="right")
        for k in found["id"].values
    ]
    captured = np.array(by, dtype=np.int64).reshape(len(by), elapsed.size)
    tails = survival.residual(times, censored, bound) if times.size else []
    return {
        "captured": (
            ("attractor", "elapsed"),
            captured,
            {"long_name": "starts captured within so many periods"},
        ),
        "elapsed": ("elapsed", elapsed, {"long_name": "periods"}),
        "tail_mean": (
            "tail_begin",
            np.array([t.mean for t in tails], dtype=float),
            {"long_name": "mean time left, periods"},
        ),
        "tail_stderr": ("tail_begin", np.array([t.stderr for t in tails], dtype=float)),
        "tail_exponential": (
            "tail_begin",
            np.array([min(t.weibull, t.steady) for t in tails], dtype=float),
            {"comment": "chance of times as unlike an exponential's, the lesser of two tests"},
        ),
        "tail_begin": (
            "tail_begin",
            np.array([t.begin for t in tails], dtype=np.int64),
            {"long_name": "periods"},
        ),
    }


def _settling(found: xr.Dataset, period: float) -> NDArray[np.int64]:
    """Periods that each start needs at its end to come near what captures it."""
    rate = -Units.of(found.attrs).bare(found["exponent"].values, RATE) * period
    rate = np.where(np.isfinite(rate) & (rate > 0), rate, _SETTLING / _LEAST_SETTLING)
    periods = np.clip(np.ceil(_SETTLING / rate), _LEAST_SETTLING, _MOST_SETTLING)
    label = found["label"].values.astype(np.int64)
    own = np.concatenate([[0], periods]).astype(np.int64)
    return np.asarray(own[np.maximum(label, 0)])


def _saddle(
    found: xr.Dataset,
    fitted: survival.Tail | None,
    pendulum: Pendulum,
    threads: int | None,
) -> tuple[float, float, int]:
    """The exponent per period while trajectories live, its standard error, and of how many.

    From ``_ALIGNED`` periods on until the settling begins that ends in capture.
    """
    none = math.nan, math.nan, 0
    if fitted is None:
        return none
    units = Units.of(found.attrs)
    settle, label = found["settle_periods"].values, found["label"].values
    end = np.where(settle >= 0, settle, found.attrs["max_periods"])
    end = end - _settling(found, pendulum.period)
    chaos = np.array([str(kind).endswith("chaos") for kind in found["kind"].values], dtype=bool)
    never = (label < 0) | np.concatenate([[False], chaos])[np.maximum(label, 0)]
    # The natural measure of the saddle is where those are that live for long.
    least = _ALIGNED + max(math.ceil(fitted.mean / 2), 10)
    chosen = np.flatnonzero((end >= min(least, _LONGEST // 2)) & ~never)[:_FOLLOWED]
    if chosen.size < _LEAST_FOLLOWED:
        return none
    end = np.minimum(end[chosen], _LONGEST)
    speeds = units.bare(found["start_velocity"].values[chosen], VELOCITY)
    growth = _core.growth(
        pendulum.parameters,
        found["start_theta"].values[chosen].copy(),
        np.ascontiguousarray(speeds),
        int(end.max()),
        1,
        int(found.attrs["steps_per_period"]),
        threads or 0,
    )
    each = np.arange(growth.shape[1])
    mine = (each >= _ALIGNED) & (each < end[:, None])
    length = mine.sum(axis=1)
    gain = np.where(mine, growth, 0.0).sum(axis=1)
    mean = gain.sum() / length.sum()
    spread = ((gain - mean * length) ** 2).sum()
    stderr = math.sqrt(spread * chosen.size / (chosen.size - 1)) / length.sum()
    return float(mean), float(stderr), int(chosen.size)


def _attributes(
    found: xr.Dataset,
    fitted: survival.Tail | None,
    saddle: tuple[float, float, int],
    pendulum: Pendulum,
    units: Units,
) -> dict[str, Any]:
    period = pendulum.period
    growth, error, followed = saddle
    persistent = found.attrs["plane"] == "only_chaos"
    chaotic, rate = False, math.nan
    if fitted is not None:
        # In a period the share 1/mean leaves.
        rate = -math.log1p(-1 / fitted.mean) if fitted.mean > 1 else math.inf
        chaotic = bool(growth - rate > _SURE * math.hypot(error, rate / math.sqrt(fitted.captured)))
    mean, stderr = (fitted.mean, fitted.stderr) if fitted and chaotic else (math.nan, math.nan)
    exponent, exponent_error = growth / period, error / period
    dimension = math.nan
    if persistent:
        exponent = units.bare(float(found["exponent"].values[0]), RATE)
        exponent_error = units.bare(float(found["exponent_stderr"].values[0]), RATE)
    elif chaotic and not pendulum.theta_r and not pendulum.effects:
        dimension = (growth - rate) * (1 / growth + 1 / (growth + pendulum.gamma * period))
    return {
        "mean_periods": mean,
        "stderr": stderr,
        "mean_time": units.given(mean * period, TIME),
        "mean_time_stderr": units.given(stderr * period, TIME),
        "persistent": int(persistent),
        "transient_chaos": int(chaotic),
        "from_period": fitted.begin if fitted else -1,
        "tail_captured": fitted.captured if fitted else 0,
        "tail_weibull": fitted.weibull if fitted else math.nan,
        "tail_steady": fitted.steady if fitted else math.nan,
        "tail_mean_periods": fitted.mean if fitted else math.nan,
        "escape_rate": rate,
        "exponent": units.given(exponent, RATE),
        "exponent_stderr": units.given(exponent_error, RATE),
        "exponent_per_period": exponent * period,
        "exponent_trajectories": followed,
        "entropy": growth - rate if chaotic else math.nan,
        "saddle_dimension": dimension,
    }


def _summary(dataset: xr.Dataset, found: xr.Dataset) -> list[str]:
    a, units = dataset.attrs, Units.of(dataset.attrs)
    lines: list[str] = []
    exponent = f"{a['exponent']:.4f} +- {a['exponent_stderr']:.4f} {units.per_time}"
    if a["persistent"]:
        name = str(found["attractor"].values[0])
        lines.append(
            f"Persistent: {name}, exponent {exponent}; nothing captured any of the trajectories "
            f"watched within {a['chaos_bound']} periods."
        )
    elif found.attrs["plane"] == "conservative":
        lines.append("Without damping (gamma = 0) nothing is ever captured: no lifetime.")
    elif a["transient_chaos"]:
        lines += _of_tail(dataset, exponent)
    else:
        lines.append(_why_not(dataset, exponent))
    if a["chaotic_share"] and not a["persistent"]:
        lines.append(
            f"{100 * a['chaotic_share']:.3g} % of the starts end on a chaotic attractor, and are "
            "left out: there chaos persists."
        )
    if a["censored"] and found.attrs["plane"] == "basins":
        lines.append(
            f"{counted(a['censored'], 'start')} of {a['starts']} were alive at the bound of "
            f"{counted(a['max_periods'], 'period')}."
        )
    if a["captured"]:
        shares = [
            f"{name} {100 * float(share):.2f} %"
            for name, share in zip(found["attractor"].values, found["fraction"].values, strict=True)
        ]
        lines.append(f"Ended on {', '.join(shares)}.")
    lines.append(
        f"{counted(a['starts'], 'start')}, {counted(a['steps_per_period'], 'step')} a period, "
        f"error reached {a['reached_error']:.1e}, {a['seconds']:.2f} s on "
        f"{counted(a['threads'], 'thread')} ({a['simd']})."
    )
    return lines


def _of_tail(dataset: xr.Dataset, exponent: str) -> list[str]:
    a, units = dataset.attrs, Units.of(dataset.attrs)
    mean, error = a["mean_periods"], a["stderr"]
    places = max(0, 1 - math.floor(math.log10(error)))
    clock = units.seconds(f"{a['mean_time']:.4g}") if units.si else f"tau = {a['mean_time']:.4g}"
    said = (
        f"Transient chaos lives for {mean:.{places}f} +- {error:.{places}f} periods on average "
        f"({clock}): the tail of {counted(a['tail_captured'], 'capture')} after period "
        f"{a['from_period']}."
    )
    lines = [said]
    tests = min(a["tail_weibull"], a["tail_steady"])
    if tests < survival.LEVEL:
        lines.append(
            f"THE TAIL FROM PERIOD {a['from_period']} IS NOT EXPONENTIAL (chance {tests:.1g}): "
            "its mean depends on where it begins."
        )
    line = (
        f"On the chaotic saddle: exponent {exponent}, {a['exponent_per_period']:.4f} per period; "
        f"rate of escape {a['escape_rate']:.5f}, entropy {a['entropy']:.4f} per period"
    )
    if math.isfinite(a["saddle_dimension"]):
        line += f"; dimension {a['saddle_dimension']:.3f}"
    return [*lines, line + "."]


def _why_not(dataset: xr.Dataset, exponent: str) -> str:
    a = dataset.attrs
    if not a["captured"]:
        return (
            "No start was captured, and nothing says that chaos persists: undecided within "
            f"{counted(a['max_periods'], 'period')}; --max-periods raises this bound."
        )
    longest = int(dataset["capture_period"].max())
    head = f"No transient chaos: all settling ends within {counted(longest, 'period')}"
    if not math.isfinite(a["tail_mean_periods"]):
        return f"{head}, without an exponential tail."
    head += f", with a tail of {a['tail_mean_periods']:.3g} periods"
    if not math.isfinite(a["exponent_per_period"]):
        return f"{head}, in which no start lives on to wander."
    return (
        f"{head}, in which deviations grow no faster than starts leave (exponent {exponent}, "
        f"{a['exponent_per_period']:.3g} per period; rate {a['escape_rate']:.3g}): those at the "
        "edge of a basin."
    )
