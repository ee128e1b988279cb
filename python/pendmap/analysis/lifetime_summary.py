"""What the summary of a lifetime says."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pendmap.analysis import survival
from pendmap.analysis.orbit_table import chaotic
from pendmap.analysis.summary import effort
from pendmap.files import facts
from pendmap.formatting import counted, with_error
from pendmap.units import Units

if TYPE_CHECKING:
    import xarray as xr


def summary_of(dataset: xr.Dataset, basin_map: xr.Dataset) -> list[str]:
    """Return the lines about the lifetimes ``dataset`` of the starts of the map ``basin_map``."""
    a = facts(dataset)
    units = Units.of(a)
    lines: list[str] = []
    exponent = f"{with_error(a['chaos_exponent'], a['chaos_exponent_stderr'])} {units.per_time}"
    if a["persistent"]:
        lines.append(
            f"Persistent: {_shares(basin_map)}; largest exponent {exponent}; none of the "
            f"trajectories followed was captured within {a['chaos_bound']} periods."
        )
    elif basin_map.attrs["plane"] == "conservative":
        lines.append("Without damping (gamma = 0) there are no attractors: no lifetime.")
    elif a["transient_chaos"]:
        lines += _of_tail(dataset, exponent)
    else:
        lines.append(_why_not(dataset, exponent))
    if a["chaotic_share"] and not a["persistent"]:
        names = basin_map["attractor"].values[chaotic(basin_map)]
        lines.append(
            f"{100 * a['chaotic_share']:.3g} % of the starts end on {', '.join(names)}, and are "
            f"left out: chaos there was not captured within {a['chaos_bound']} periods."
        )
    if a["censored"] and basin_map.attrs["plane"] == "basins":
        lines.append(
            f"{counted(a['censored'], 'start')} of {a['starts']} were alive at the bound of "
            f"{counted(a['max_periods'], 'period')}."
        )
    if a["captured_starts"]:
        lines.append(f"Ended on {_shares(basin_map)}.")
    return [*lines, f"{counted(a['starts'], 'start')}, {effort(a)}"]


def _shares(basin_map: xr.Dataset) -> str:
    """Return the attractors with the share of the starts that each captures, as text."""
    rows = zip(basin_map["attractor"].values, basin_map["fraction"].values, strict=True)
    return ", ".join(f"{name} {100 * float(share):.2f} %" for name, share in rows)


def _of_tail(dataset: xr.Dataset, exponent: str) -> list[str]:
    a = facts(dataset)
    units = Units.of(a)
    clock = units.seconds(f"{a['mean_time']:.4g}") if units.si else f"tau = {a['mean_time']:.4g}"
    mean = with_error(a["mean_periods"], a["mean_periods_stderr"])
    sentence = (
        f"Transient chaos lives for {mean} periods on average ({clock}): the tail of "
        f"{counted(a['tail_captured'], 'capture')} after period "
        f"{a['from_period']}."
    )
    lines = [sentence]
    tests = min(a["tail_weibull"], a["tail_steady"])
    if tests < survival.LEVEL:
        lines.append(
            f"THE TAIL FROM PERIOD {a['from_period']} IS NOT EXPONENTIAL (chance {tests:.1g}): "
            "its mean depends on where it begins."
        )
    line = (
        f"On the chaotic saddle: exponent {exponent}, {a['exponent_per_period']:.4g} per period; "
        f"rate of escape {a['escape_rate']:.4g}, entropy {a['entropy']:.4g} per period"
    )
    if math.isfinite(a["saddle_dimension"]):
        line += f"; dimension {a['saddle_dimension']:.3f}"
    return [*lines, line + "."]


def _why_not(dataset: xr.Dataset, exponent: str) -> str:
    a = facts(dataset)
    if not a["captured_starts"] and a["chaotic_share"]:
        return "Starts end only on chaotic attractors: no lifetime."
    if not a["captured_starts"]:
        return (
            "No start was captured, and chaos is not shown to persist: undecided within "
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


def summary_of_draws(a: dict[str, Any]) -> list[str]:
    """Return the lines about the lifetimes of draws."""
    lines = []
    if a["transient_share"]:
        lines.append(
            f"Mean lifetime: 95 % of the draws in [{a['mean_periods_low']:.4g}, "
            f"{a['mean_periods_high']:.4g}] periods."
        )
    lines.append(
        f"{100 * a['transient_share']:.3g} % of the draws have transient chaos; in "
        f"{100 * a['persistent_share']:.3g} % chaos persists."
    )
    return lines
