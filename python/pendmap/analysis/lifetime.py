"""Lifetime of transient chaos: the time until an attractor captures a trajectory."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any, Final, Unpack

import numpy as np

from pendmap.analysis import result, survival
from pendmap.analysis.basin_tiles import BasinTiles, Starts
from pendmap.analysis.basins import choices_of, ends_of_list
from pendmap.analysis.draws import drawn, drawn_field, interval
from pendmap.analysis.grid import FASTEST
from pendmap.analysis.grid import starts as checked
from pendmap.analysis.lifetime_summary import summary_of, summary_of_draws
from pendmap.analysis.numerics import Numerics, optional_whole
from pendmap.analysis.orbit_table import chaotic
from pendmap.analysis.result import Field, Found, Schema
from pendmap.analysis.run import RunOptions
from pendmap.analysis.summary import window_said
from pendmap.errors import MOST_PERIODS, InputError, check_whole
from pendmap.files import facts
from pendmap.files.variables import flag, variable
from pendmap.model import without_dimensions
from pendmap.units import RATE, TIME, VELOCITY, Units

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from pendmap.analysis.draws import Analysis, Draws
    from pendmap.analysis.run import Keywords
    from pendmap.engine import Work
    from pendmap.model import Pendulum, Rig


_MOST_STARTS: Final = 10_000_000  # Largest number of starts
_SURE: Final = 3.0
"""Excess of the exponent over the escape rate that shows transient chaos, standard errors."""
_STORED: Final = 4000  # Largest number of periods of a stored survival curve
_DRAWN: Final = ("mean_periods", "mean_periods_stderr", "transient_chaos", "persistent")
"""Facts that are kept of each draw."""


def _attractors(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the attractors with their captures for the JSON object."""
    last = dataset.isel(elapsed=-1)
    return result.records(last, name="attractor", fraction="fraction", captured="captured")


@drawn_field
def drawn_lifetimes(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the draws of a lifetime for the JSON object."""
    a = facts(dataset)
    return {
        "mean_periods_ci95": [a["mean_periods_low"], a["mean_periods_high"]],
        "transient_share": a["transient_share"],
        "persistent_share": a["persistent_share"],
    }


SCHEMA = Schema(
    "lifetime",
    result.UNITS,
    Found("mean_periods", "periods", "mean lifetime of transient chaos"),
    Found("stderr", "periods", "its standard error", variable="mean_periods_stderr"),
    Found("persistent", result.FLAG, "1 where every start ends on chaos", convert=bool),
    Found("transient_chaos", result.FLAG, "1 where there is transient chaos", convert=bool),
    Found("from_period", "periods", "beginning of the tail; -1: none", convert=result.none_below_0),
    Found("mean_time", result.OF_TIME, "mean lifetime as a time"),
    Found("mean_time_stderr", result.OF_TIME, "its standard error"),
    Found("escape_rate", "1/period", "rate at which starts leave the saddle"),
    Found(
        "exponent",
        result.OF_RATE,
        "Lyapunov exponent on the saddle, or of lasting chaos",
        variable="chaos_exponent",
    ),
    Found(
        "exponent_stderr", result.OF_RATE, "its standard error", variable="chaos_exponent_stderr"
    ),
    Found("exponent_per_period", "1/period", "the exponent per forcing period"),
    Found("entropy", "1/period", "metric entropy of the saddle"),
    Found("saddle_dimension", "1", "dimension of the saddle"),
    Found("tail_captured", "1", "captures in the tail"),
    Found("tail_weibull", "1", "chance of an exponential tail by a score test of the shape"),
    Found("tail_steady", "1", "chance of an exponential tail by chi squared of its rates"),
    Found("tail_mean_periods", "periods", "mean time of the tail, exponential or not"),
    Field("starts", "1", "starts"),
    Found("captured", "1", "starts that an attractor captured", variable="captured_starts"),
    Found("censored", "1", "starts alive at the bound"),
    Found("failed", "1", "starts that failed or diverged"),
    Found("chaotic_share", "1", "share of the starts that end on a chaotic attractor"),
    result.BOUND,
    result.CHAOS_BOUND,
    result.TOL,
    result.REACHED,
    result.STEPS,
    *result.RUN,
    Field("attractors", "", "attractors with the starts that each captured", read=_attractors),
    *result.END,
    drawn_lifetimes,
    result.SECTION,
    Field("from_period_given", "", "1 where the caller chose the beginning", json=False),
    Field("exponent_trajectories", "1", "trajectories the exponent was measured on", json=False),
    references="Kantz & Grassberger (1985), Physica D 17, 75",
)


def lifetime(  # noqa: PLR0913 (physics first, numerical choices by name)
    pendulum: Pendulum | Rig,
    theta: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    *,
    starts: int = 40_000,
    from_period: int | None = None,
    max_periods: int | None = None,
    tol: float = 1e-6,
    draws: int | None = None,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> xr.Dataset:
    """Estimate the mean lifetime of transient chaos from the exponential tail of capture times.

    Starts drawn from a window run until an attractor captures them. Transient chaos is a chaotic
    saddle: the number of trajectories still on it after ``t`` periods decays as ``exp(-t / mean)``.
    The mean is the maximum-likelihood estimate, the sum of all times beyond ``from_period``,
    censored ones included, over the number of captures; its standard error is ``mean /
    sqrt(captured)``.

    An exponential tail does not prove chaos: starts near a smooth basin boundary leave its saddle
    at a rate ``kappa`` too. There ``kappa`` equals the saddle's exponent ``lambda``; on a chaotic
    saddle deviations grow faster than trajectories leave, and ``lambda - kappa`` is its entropy
    (Kantz & Grassberger 1985). The growth of deviations is measured along trajectories before their
    capture; where ``lambda`` does not exceed ``kappa`` there is no transient chaos.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; with a rig velocities are in rad/s.
    theta, velocity : array_like, shape (N,), optional
        Starts at ``tau = 0``; by default drawn at random from [-pi, pi] x [-3, 3], with a rig from
        [-pi, pi] x [-3 w0, 3 w0].
    starts : int
        Number of starts drawn, from angles -pi to pi and velocities -3 to 3 (in SI times ``w0``);
        100 to ten million.
    from_period : int, optional
        Period at which the exponential tail begins; by default twice the earliest from which two
        tests (of a Weibull shape, and of a rate that changes) find it exponential.
    draws : int, optional
        As for :func:`pendmap.basins`; adds the interval of the mean lifetime.
    max_periods, tol, run
        As for :func:`pendmap.basins`.

    Returns
    -------
    xarray.Dataset
        ``captured`` over ``attractor`` and ``elapsed``: the number that each attractor has captured
        up to a period. ``tail_mean`` and ``tail_stderr`` over ``tail_begin``, the mean from other
        beginnings. ``start_theta``, ``start_velocity``, ``capture_period`` (-1:
        never) and ``label`` over ``start``. Without dimensions ``mean_periods``,
        ``mean_periods_stderr``, ``from_period``, ``persistent`` (1 where every start ends on chaos;
        ``chaos_exponent`` is that of the most chaotic attractor then), ``transient_chaos``,
        ``escape_rate`` and ``entropy`` per period, ``chaos_exponent`` on the saddle,
        ``saddle_dimension``; nan where one has no meaning.

    Raises
    ------
    InputError
        If a value is outside its range, or the model has an effect that no map can have.

    References
    ----------
    Kantz & Grassberger (1985), Physica D 17, 75; Lai & Tel (2011), Transient Chaos, chapter 2.

    Examples
    --------
    >>> import pendmap
    >>> pendulum = pendmap.Pendulum(gamma=0.1, p=1.7, omega=2.0)
    >>> result = pendmap.lifetime(pendulum, starts=400)
    >>> round(float(result["mean_periods"]))
    132
    """
    bare, units = without_dimensions(pendulum)
    starts = check_whole("starts", starts, survival.LEAST, _MOST_STARTS)
    from_period = optional_whole("from_period", from_period, 0, MOST_PERIODS)
    run = RunOptions.of(run, options)
    numerics = Numerics(run, tol, max_periods)
    if (theta is None) != (velocity is None):
        raise InputError("both or none of theta and velocity must be given, got one")
    if draws is not None:
        several = drawn(pendulum, draws, run)
        same = partial(lifetime, from_period=from_period, tol=tol, max_periods=max_periods)
        first = same(pendulum, theta, velocity, starts=starts, run=several.first)
        again = partial(same, theta=first["start_theta"], velocity=first["start_velocity"])
        return lifetime_over(first, several, again)
    request: dict[str, Any] = {
        **numerics.request,
        "starts": starts,
        "from_period": from_period,
        "theta": None,
        "velocity": None,
    }
    window = ""
    if theta is None or velocity is None:
        draw = np.random.default_rng(run.seed)
        reach = units.given(FASTEST, VELOCITY)
        theta = draw.uniform(-math.pi, math.pi, starts)
        velocity = draw.uniform(-reach, reach, starts)
        window = window_said((-math.pi, math.pi), (-reach, reach), units)
    angles, speeds = checked(theta, velocity)
    if not window:
        request |= {"theta": angles, "velocity": speeds}
    states = Starts(None, angles, units.bare(speeds, VELOCITY))
    choices = choices_of(numerics, None, check=False)
    rate, threads = units.given(1.0, RATE), run.tiles(1)[0]
    job = BasinTiles(bare, states, choices, rate, threads)

    def compute(work: Work) -> xr.Dataset:
        basin_map = ends_of_list(job, work, speeds, pendulum, numerics, check=False)
        return _complete(basin_map, pendulum, numerics, from_period, window)

    return run.complete("lifetime", pendulum, request, job, compute)


def _complete(
    basin_map: xr.Dataset,
    pendulum: Pendulum | Rig,
    numerics: Numerics,
    from_period: int | None,
    window: str,
) -> xr.Dataset:
    """Return the lifetimes of the starts that end as in ``basin_map``."""
    bare, units = without_dimensions(pendulum)
    label = basin_map["label"].values.astype(np.int64)
    settle = basin_map["settle_periods"].values.astype(np.int64)
    times = settle[settle >= 0]
    bound, censored = int(basin_map.attrs["max_periods"]), int((label == 0).sum())
    fitted = None
    if times.size and basin_map.attrs["plane"] == "basins":
        if from_period is None:
            fitted = survival.begin(times, censored, bound)
        elif from_period < bound:
            fitted = survival.tail(times, censored, bound, from_period)
            fitted = fitted if fitted.captured else None
    saddle = survival.growth_on_saddle(basin_map, fitted, bare, numerics.run.workers)
    dataset = basin_map.drop_dims("start").assign(
        {
            **_curves(basin_map, times, censored, bound),
            **{name: basin_map[name] for name in ("start_theta", "start_velocity", "label")},
            "capture_period": variable(
                "start", settle.astype(np.int32), "periods", "capture", "-1: never", missing=-1
            ),
        }
    )
    values = {
        **facts(basin_map),
        **numerics.provenance(),
        **_measures(basin_map, fitted, saddle, bare, units),
        "starts": label.size,
        "captured": int(times.size),
        "censored": censored,
        "failed": int((label < 0).sum()),
        "chaotic_share": _chaotic(basin_map),
        "from_period_given": int(from_period is not None),
    }
    SCHEMA.complete(dataset, pendulum, values)
    lines = summary_of(dataset, basin_map)
    if window:
        lines.append(f"Starts are drawn in {window}.")
    result.summarised(dataset, lines, pendulum, "these lifetimes are")
    return dataset


def _chaotic(basin_map: xr.Dataset) -> float:
    """Return the share of the starts that end on a chaotic attractor."""
    return float(basin_map["fraction"].values[chaotic(basin_map)].sum())


def _curves(
    basin_map: xr.Dataset, times: NDArray[np.int64], censored: int, bound: int
) -> dict[str, Any]:
    """Return captures up to each period by each attractor, and tails from all beginnings."""
    label, settle = basin_map["label"].values, basin_map["settle_periods"].values
    last = bound if censored else int(times.max(initial=0)) + 1
    elapsed = np.unique(np.linspace(0, last, min(last, _STORED) + 1).round().astype(np.int64))
    by = [
        np.searchsorted(np.sort(settle[(label == k) & (settle >= 0)]), elapsed, side="right")
        for k in basin_map["id"].values
    ]
    captured = np.array(by, dtype=np.int64).reshape(len(by), elapsed.size)
    tails = survival.residual(times, censored, bound) if times.size else []
    rows = [(t.begin, t.mean, t.stderr, min(t.weibull, t.steady)) for t in tails]
    begin, mean, stderr, chance = np.array(rows, dtype=float).reshape(-1, 4).T
    within = "starts captured up to this period"
    one, unlike = "tail_begin", "chance of times as unlike an exponential's, lesser of two tests"
    return {
        "captured": variable(("attractor", "elapsed"), captured, "1", within),
        "elapsed": variable("elapsed", elapsed, "periods", "time since the start"),
        "tail_mean": variable(one, mean, "periods", "mean time left"),
        "tail_stderr": variable(one, stderr, "periods", "standard error of the mean time left"),
        "tail_exponential": variable(one, chance, "1", unlike),
        "tail_begin": variable(one, begin.astype(np.int64), "periods", "beginning of the tail"),
    }


def _measures(
    basin_map: xr.Dataset,
    fitted: survival.Tail | None,
    saddle: tuple[float, float, int],
    pendulum: Pendulum,
    units: Units,
) -> dict[str, Any]:
    """Return the measures of the tail, the saddle or persistent chaos as facts."""
    period = pendulum.period
    growth, error, followed = saddle
    persistent = basin_map.sizes["attractor"] > 0 and math.isclose(_chaotic(basin_map), 1.0)
    chaotic, rate = False, math.nan
    if fitted is not None:
        # The fraction 1/mean leaves in each period.
        rate = -math.log1p(-1 / fitted.mean) if fitted.mean > 1 else math.inf
        chaotic = bool(growth - rate > _SURE * math.hypot(error, rate / math.sqrt(fitted.captured)))
    mean, stderr = (fitted.mean, fitted.stderr) if fitted and chaotic else (math.nan, math.nan)
    exponent, exponent_error = growth / period, error / period
    dimension = math.nan
    if persistent:
        largest = int(np.argmax(basin_map["exponent"].values))
        exponent = units.bare(float(basin_map["exponent"].values[largest]), RATE)
        exponent_error = units.bare(float(basin_map["exponent_stderr"].values[largest]), RATE)
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


def lifetime_over(dataset: xr.Dataset, draws: Draws, analysis: Analysis) -> xr.Dataset:
    """Return a lifetime with the lifetimes of D draws from the same starts.

    Adds ``drawn_mean_periods`` and ``drawn_stderr`` (D), nan without transient chaos,
    ``drawn_persistent`` (D) and ``drawn`` (D, parameter); ``mean_periods_low`` and
    ``mean_periods_high``, the 95 % interval over the draws, which includes the counting error;
    ``transient_share`` and ``persistent_share``.
    """
    rows = [[float(one[key]) for key in _DRAWN] for one in draws.each(analysis)]
    mean, error, transient, persistent = np.array(rows).T
    _, _, low, high = interval(mean)
    lives, share = "mean lifetime of transient chaos", "share of the draws that"
    with_draws = dataset.assign(
        drawn_mean_periods=variable("draw", mean, "periods", lives),
        drawn_stderr=variable("draw", error, "periods", f"standard error of the {lives}"),
        drawn_persistent=flag("draw", persistent, "whether chaos persists"),
        mean_periods_low=variable((), float(low), "periods", f"lower end of 95 % of the {lives}"),
        mean_periods_high=variable((), float(high), "periods", f"upper end of 95 % of the {lives}"),
        transient_share=variable((), transient.mean(), "1", f"{share} have transient chaos"),
        persistent_share=variable((), persistent.mean(), "1", f"{share} have persistent chaos"),
    )
    return draws.complete(with_draws, summary_of_draws(facts(with_draws)))
