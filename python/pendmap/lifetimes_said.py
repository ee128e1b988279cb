"""What a lifetime of transient chaos says of itself."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pendmap import survival
from pendmap.model.units import Units
from pendmap.words import counted, with_error

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["summary"]


def summary(dataset: xr.Dataset, found: xr.Dataset) -> list[str]:
    """Return the lines about the lifetimes ``dataset`` of the starts of the map ``found``."""
    a, units = dataset.attrs, Units.of(dataset.attrs)
    lines: list[str] = []
    exponent = f"{with_error(a['exponent'], a['exponent_stderr'])} {units.per_time}"
    if a["persistent"]:
        lines.append(
            f"Persistent: {shares(found)}; largest exponent {exponent}; nothing captured any of "
            f"the trajectories watched within {a['chaos_bound']} periods."
        )
    elif found.attrs["plane"] == "conservative":
        lines.append("Without damping (gamma = 0) nothing is ever captured: no lifetime.")
    elif a["transient_chaos"]:
        lines += _of_tail(dataset, exponent)
    else:
        lines.append(_why_not(dataset, exponent))
    if a["chaotic_share"] and not a["persistent"]:
        names = [
            str(name)
            for name, kind in zip(found["attractor"].values, found["kind"].values, strict=True)
            if str(kind).endswith("chaos")
        ]
        lines.append(
            f"{100 * a['chaotic_share']:.3g} % of the starts end on {', '.join(names)}, and are "
            f"left out: nothing captured chaos there within {a['chaos_bound']} periods."
        )
    if a["censored"] and found.attrs["plane"] == "basins":
        lines.append(
            f"{counted(a['censored'], 'start')} of {a['starts']} were alive at the bound of "
            f"{counted(a['max_periods'], 'period')}."
        )
    if a["captured"]:
        lines.append(f"Ended on {shares(found)}.")
    lines.append(
        f"{counted(a['starts'], 'start')}, {counted(a['steps_per_period'], 'step')} a period, "
        f"error reached {a['reached_error']:.1e}, {a['seconds']:.2f} s on "
        f"{counted(a['threads'], 'thread')} ({a['simd']})."
    )
    return lines


def shares(found: xr.Dataset) -> str:
    """Return the attractors with the share of the starts that each takes."""
    rows = zip(found["attractor"].values, found["fraction"].values, strict=True)
    return ", ".join(f"{name} {100 * float(share):.2f} %" for name, share in rows)


def _of_tail(dataset: xr.Dataset, exponent: str) -> list[str]:
    a, units = dataset.attrs, Units.of(dataset.attrs)
    clock = units.seconds(f"{a['mean_time']:.4g}") if units.si else f"tau = {a['mean_time']:.4g}"
    mean = with_error(a["mean_periods"], a["stderr"])
    said = (
        f"Transient chaos lives for {mean} periods on average ({clock}): the tail of "
        f"{counted(a['tail_captured'], 'capture')} after period "
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
        f"On the chaotic saddle: exponent {exponent}, {a['exponent_per_period']:.4g} per period; "
        f"rate of escape {a['escape_rate']:.4g}, entropy {a['entropy']:.4g} per period"
    )
    if math.isfinite(a["saddle_dimension"]):
        line += f"; dimension {a['saddle_dimension']:.3f}"
    return [*lines, line + "."]


def _why_not(dataset: xr.Dataset, exponent: str) -> str:
    a = dataset.attrs
    if not a["captured"] and a["chaotic_share"]:
        return "No start ends on anything that repeats: no lifetime."
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
