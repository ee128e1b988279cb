"""Lifetime of transient chaos: the time until an attractor captures a trajectory."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any, Final, Unpack

import numpy as np

from pendmap.analysis import result, survival
from pendmap.analysis.basin_tiles import BasinTiles, Starts
from pendmap.analysis.basins import choices_of, ends_of_list
from pendmap.analysis.draws import LEVELS, drawn, drawn_field
from pendmap.analysis.grid import FASTEST
from pendmap.analysis.orbit_table import chaotic
from pendmap.analysis.result import Field, Found, Schema
from pendmap.analysis.run import Numerics, RunOptions, optional_whole
from pendmap.analysis.summary import effort
from pendmap.errors import MOST_PERIODS, check_whole
from pendmap.files import facts
from pendmap.files.variables import variable
from pendmap.formatting import counted, with_error
from pendmap.model import without_dimensions
from pendmap.units import RATE, VELOCITY, Units

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from pendmap.analysis.draws import Analysis, Draws
    from pendmap.analysis.run import Keywords
    from pendmap.engine import Work
    from pendmap.model import Pendulum, Rig


_MOST_STARTS: Final = 10_000_000  # Largest number of starts
_SURE: Final = 3.0
"""Excess of the exponent over the escape rate that shows transient chaos, standard errors."""
_STORED: Final = 4000  # Largest number of periods of a stored survival curve


def _attractors(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the attractors with their captures for the JSON object."""
    last = dataset.isel(elapsed=-1)
    return result.records(last, name="attractor", fraction="fraction", captured="captured")


@drawn_field
def drawn_lifetimes(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the draws of a lifetime for the JSON object."""
    a = facts(dataset)
    shares = {name: a[name] for name in ("transient_share", "persistent_share")}
    return {"mean_periods_ci95": [a["mean_periods_low"], a["mean_periods_high"]]} | shares


SCHEMA = Schema(
    "lifetime",
    result.UNITS,
    Found("mean_periods", "periods", "mean lifetime of transient chaos"),
    Found("stderr", "periods", "its standard error", variable="mean_periods_stderr"),
    Found("persistent", result.FLAG, "1 where every start ends on chaos", convert=bool),
    Found("transient_chaos", result.FLAG, "1 where there is transient chaos", convert=bool),
    Found("from_period", "periods", "beginning of the tail; -1: none", convert=result.none_below_0),
    Found("escape_rate", "1/period", "rate at which starts leave the saddle"),
    Found("exponent", result.OF_RATE, "exponent of the chaos", variable="chaos_exponent"),
    Found("exponent_stderr", result.OF_RATE, "its error", variable="chaos_exponent_stderr"),
    Found("exponent_per_period", "1/period", "the exponent per forcing period"),
    Found("entropy", "1/period", "metric entropy of the saddle"),
    Found("saddle_dimension", "1", "dimension of the saddle"),
    Found("tail_captured", "1", "captures in the tail"),
    Found("tail_chance", "1", "chance of times as unlike an exponential's, by chi squared"),
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
    references="Kantz & Grassberger (1985), Physica D 17, 75",
)


def lifetime(  # noqa: PLR0913 (numerical choices by name)
    pendulum: Pendulum | Rig,
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
    censored ones included, over the number of captures; its error is ``mean / sqrt(captured)``.

    An exponential tail does not prove chaos: starts near a smooth basin boundary leave its saddle
    at a rate ``kappa`` too. There ``kappa`` equals the saddle's exponent ``lambda``; on a chaotic
    saddle deviations grow faster than trajectories leave, and ``lambda - kappa`` is its entropy
    (Kantz & Grassberger 1985). The growth of deviations is measured along trajectories before their
    capture; where ``lambda`` does not exceed ``kappa`` there is no transient chaos.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; with a rig velocities are in rad/s.
    starts : int
        Number of starts drawn, from angles -pi to pi and velocities -3 to 3 (in SI times ``w0``);
        100 to ten million.
    from_period : int, optional
        Period at which the exponential tail begins; by default twice the earliest from which chi
        squared of its rates finds it exponential.
    draws : int, optional
        As for :func:`pendmap.basins`; adds the interval of the mean lifetime.
    max_periods, tol, run
        As for :func:`pendmap.basins`.

    Returns
    -------
    xarray.Dataset
        ``captured`` over ``attractor`` and ``elapsed``: the number that each attractor has captured
        up to a period. ``tail_mean`` and ``tail_stderr`` over ``tail_begin``, the mean from other
        beginnings. ``start_theta``, ``start_velocity``, ``capture_period`` (-1: never) and
        ``label`` over ``start``. Without dimensions ``mean_periods``,
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
    if draws is not None:
        several = drawn(pendulum, draws, run)
        same = partial(
            lifetime, starts=starts, from_period=from_period, tol=tol, max_periods=max_periods
        )
        return lifetime_over(same(pendulum, run=several.first), several, same)
    request = {**numerics.request, "starts": starts, "from_period": from_period}
    source, reach = np.random.default_rng(run.seed), units.given(FASTEST, VELOCITY)
    angles = source.uniform(-math.pi, math.pi, starts)
    speeds = source.uniform(-reach, reach, starts)
    states = Starts(None, angles, units.bare(speeds, VELOCITY))
    choices = choices_of(numerics, None, check=False)
    rate, threads = units.given(1.0, RATE), run.tiles(1)[0]
    job = BasinTiles(bare, states, choices, rate, threads)

    def compute(work: Work) -> xr.Dataset:
        basin_map = ends_of_list(job, work, speeds, pendulum, numerics, check=False)
        return _complete(basin_map, pendulum, numerics, from_period)

    return run.complete("lifetime", pendulum, request, job, compute)


def _complete(
    basin_map: xr.Dataset, pendulum: Pendulum | Rig, numerics: Numerics, from_period: int | None
) -> xr.Dataset:
    """Return the lifetimes of the starts that end as in ``basin_map``."""
    label, settle = (basin_map[n].values.astype(np.int64) for n in ("label", "settle_periods"))
    times, bound = settle[settle >= 0], int(basin_map.attrs["max_periods"])
    censored, fitted = int((label == 0).sum()), None
    if times.size and basin_map.attrs["plane"] == "basins":
        fitted = survival.begin(times, censored, bound, from_period)
    texts = ("periods", "capture", "-1: never")
    variables = {
        **_curves(basin_map, times, censored, bound),
        **{name: basin_map[name] for name in ("start_theta", "start_velocity", "label")},
        "capture_period": variable("start", settle.astype(np.int32), *texts, missing=-1),
    }
    dataset = basin_map.drop_dims("start").assign(variables)
    values = {
        **facts(basin_map),
        **numerics.provenance(),
        **_measures(basin_map, fitted, pendulum, numerics.run.workers),
        "starts": label.size,
        "captured": int(times.size),
        "censored": censored,
        "failed": int((label < 0).sum()),
    }
    SCHEMA.complete(dataset, pendulum, values)
    lines = _summary(dataset, basin_map, pendulum.period)
    result.summarised(dataset, lines, pendulum, "these lifetimes are")
    return dataset


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
    tails = survival.residual(times, censored, bound)
    rows = [(tail.begin, tail.mean, tail.stderr, tail.chance) for tail in tails]
    begin, mean, stderr, chance = np.array(rows, dtype=float).reshape(-1, 4).T
    within = "starts captured up to this period"
    one, unlike = "tail_begin", "chance of times as unlike an exponential's, by chi squared"
    return {
        "captured": variable(("attractor", "elapsed"), captured, "1", within),
        "elapsed": variable("elapsed", elapsed, "periods", "time since the start"),
        "tail_mean": variable(one, mean, "periods", "mean time left"),
        "tail_stderr": variable(one, stderr, "periods", "standard error of the mean time left"),
        "tail_exponential": variable(one, chance, "1", unlike),
        "tail_begin": variable(one, begin.astype(np.int64), "periods", "beginning of the tail"),
    }


def _measures(
    basin_map: xr.Dataset, fitted: survival.Tail | None, model: Pendulum | Rig, threads: int
) -> dict[str, Any]:
    """Return the measures of the tail, the saddle or persistent chaos as facts."""
    pendulum, units = without_dimensions(model)
    growth, error = survival.growth_on_saddle(basin_map, fitted, pendulum, threads)
    lasting = chaotic(basin_map)
    share = float(basin_map["fraction"].values[lasting].sum())
    persistent = bool(lasting.any()) and math.isclose(share, 1.0)
    transient, rate, dimension = False, math.nan, math.nan
    if fitted is not None:
        # The fraction 1/mean leaves in each period.
        rate = -math.log1p(-1 / fitted.mean) if fitted.mean > 1 else math.inf
        noise = math.hypot(error, rate / math.sqrt(fitted.captured))
        transient = bool(growth - rate > _SURE * noise)
    exponent, stderr = (units.given(x / pendulum.period, RATE) for x in (growth, error))
    if persistent:
        largest = int(np.argmax(basin_map["exponent"].values))
        exponent = float(basin_map["exponent"].values[largest])
        stderr = float(basin_map["exponent_stderr"].values[largest])
    elif transient and not pendulum.theta_r and not pendulum.effects:
        shrink = growth + pendulum.gamma * pendulum.period
        dimension = (growth - rate) * (1 / growth + 1 / shrink)
    return {
        "mean_periods": fitted.mean if fitted and transient else math.nan,
        "stderr": fitted.stderr if fitted and transient else math.nan,
        "persistent": int(persistent),
        "transient_chaos": int(transient),
        "chaotic_share": share,
        "from_period": fitted.begin if fitted else -1,
        "tail_captured": fitted.captured if fitted else 0,
        "tail_chance": fitted.chance if fitted else math.nan,
        "escape_rate": rate,
        "exponent": exponent,
        "exponent_stderr": stderr,
        "exponent_per_period": units.bare(exponent, RATE) * pendulum.period,
        "entropy": growth - rate if transient else math.nan,
        "saddle_dimension": dimension,
    }


def _summary(dataset: xr.Dataset, basin_map: xr.Dataset, period: float) -> list[str]:
    a = facts(dataset)
    units, lines = Units.of(a), []
    shares = result.rows(basin_map, "attractor", "fraction")
    ends = ", ".join(f"{name} {100 * share:.2f} %" for name, share in shares)
    exponent = f"{with_error(a['chaos_exponent'], a['chaos_exponent_stderr'])} {units.per_time}"
    per_period = f"{a['exponent_per_period']:.4g} per period; rate of escape {a['escape_rate']:.4g}"
    if a["persistent"]:
        lines.append(
            f"Persistent: {ends}; largest exponent {exponent}; none of the trajectories followed "
            f"was captured within {a['chaos_bound']} periods."
        )
    elif basin_map.attrs["plane"] == "conservative":
        lines.append("Without damping (gamma = 0) there are no attractors: no lifetime.")
    elif a["transient_chaos"]:
        mean = with_error(a["mean_periods"], a["mean_periods_stderr"])
        lines.append(
            f"Transient chaos lives for {mean} periods on average "
            f"({units.at(format(a['mean_periods'] * period, '.4g'))}): the tail of "
            f"{counted(a['tail_captured'], 'capture')} after period {a['from_period']}."
        )
        if a["tail_chance"] < survival.LEVEL:
            lines.append(
                f"THE TAIL FROM PERIOD {a['from_period']} IS NOT EXPONENTIAL (chance "
                f"{a['tail_chance']:.1g}): its mean depends on where it begins."
            )
        entropy, dimension = f"entropy {a['entropy']:.4g}", a["saddle_dimension"]
        line = f"On the chaotic saddle: exponent {exponent}, {per_period}, {entropy}"
        lines.append(line + (f"; dimension {dimension:.3f}." if dimension > 0 else "."))
    elif not a["captured_starts"]:
        lines.append(
            f"No start was captured: undecided within {counted(a['max_periods'], 'period')}; "
            "--max-periods raises this bound."
        )
    else:
        longest = counted(int(dataset["capture_period"].max()), "period")
        line = f"No transient chaos: all settling ends within {longest}"
        if math.isfinite(a["exponent_per_period"]):
            line += f"; deviations grow no faster than starts leave (exponent {per_period})"
        lines.append(f"{line}.")
    if a["chaotic_share"] and not a["persistent"]:
        names = ", ".join(basin_map["attractor"].values[chaotic(basin_map)])
        lines.append(f"Left out: {100 * a['chaotic_share']:.3g} % of the starts, on {names}.")
    if a["censored"] and basin_map.attrs["plane"] == "basins":
        bound = counted(a["max_periods"], "period")
        lines.append(f"{counted(a['censored'], 'start')} were alive at the bound of {bound}.")
    if a["captured_starts"]:
        lines.append(f"Ended on {ends}.")
    return [*lines, f"{counted(a['starts'], 'start')}, {effort(a)}"]


def lifetime_over(dataset: xr.Dataset, draws: Draws, analysis: Analysis) -> xr.Dataset:
    """Return a lifetime with those of draws; their interval includes the counting error."""
    names = ("mean_periods", "transient_chaos", "persistent")
    rows = [[float(one[name]) for name in names] for one in draws.results(analysis)]
    mean, transient, persistent = np.array(rows).T
    known = mean[np.isfinite(mean)]
    low, high = np.quantile(known, LEVELS) if known.size else (math.nan, math.nan)
    text, share = "mean lifetime of transient chaos", "share of the draws that have"
    with_draws = dataset.assign(
        drawn_mean_periods=variable("draw", mean, "periods", text),
        mean_periods_low=variable((), low, "periods", f"lower end of 95 % of the {text}"),
        mean_periods_high=variable((), high, "periods", f"upper end of 95 % of the {text}"),
        transient_share=variable((), transient.mean(), "1", f"{share} transient chaos"),
        persistent_share=variable((), persistent.mean(), "1", f"{share} persistent chaos"),
    )
    line = f"{100 * transient.mean():.3g} % of the draws have transient chaos, 95 % of the mean "
    line += f"lifetimes in [{low:.4g}, {high:.4g}] periods; "
    line += f"in {100 * persistent.mean():.3g} % chaos persists."
    return draws.complete(with_draws, [line])
