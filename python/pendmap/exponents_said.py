"""What a Lyapunov exponent says of itself."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pendmap.model.units import Units
from pendmap.words import counted

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["summary"]


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
