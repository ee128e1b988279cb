"""Summary of a basin map, and lines common to several summaries."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

from pendmap.analysis.result import missed, rows
from pendmap.files import facts
from pendmap.formatting import counted, percent, with_error, written
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr

    from pendmap.model import Pendulum

_NEARLY_CHANCE: Final = 0.15  # Excess of agreement over chance below which it is hardly better
_SPECIAL: Final = {
    "conservative": "Without damping (gamma = 0) phase area is kept and there are no attractors",
    "only_chaos": "Chaos captures all starts: labels carry no information",
}
"""What is special about a plane without basins."""


def summary_of(dataset: xr.Dataset, pendulum: Pendulum) -> list[str]:
    """Return the summary of a basin map whose facts are set, one sentence a line."""
    a, plane = facts(dataset), dataset.attrs["plane"]
    lines = []
    if "theta" in dataset.dims:
        theta, velocity = (
            dataset[f"{name}_bounds"].values[[0, -1], [0, 1]].tolist()
            for name in ("theta", "velocity")
        )
        window = window_said(theta, velocity, Units.of(a))
        lines.append(f"{window}: {counted(a['cells'], 'start')}.")
    if plane != "conservative":
        lines += _attractors(dataset)
    if plane == "basins":
        if a["longest_settle"] >= 0:
            mean, longest = a["mean_settle"], a["longest_settle"]
            lines.append(f"Settling takes {mean:.1f} periods on average, {longest} at most.")
        if (dataset["fraction"].values > 0).any():
            lines += _texture(dataset)
        if not a["labels_reliable"]:
            lines.append(
                f"LABELS OF SINGLE CELLS ARE NOT RELIABLE HERE ({100 * a['unreliable']:.1f} % of "
                f"{a['labels_sampled']} change by half the step or mirroring): read the shares and "
                "the settling time."
            )
    else:
        lines.append(
            f"{_SPECIAL[plane]}: net turns and the finite-time exponent after "
            f"{counted(a['layer_periods'], 'period')} are shown instead."
        )
    if plane != "conservative":
        unlimited, bound = unlimited_rotation(pendulum), counted(a["max_periods"], "period")
        hint = "" if unlimited else "; --max-periods raises this bound"
        lines += undecided(a, f" within {bound}{hint}")
        lines += unlimited if a["undecided"] > 0 else []
    return [*lines, f"{a['mean_periods']:.1f} periods a start on average, {effort(a)}"]


def undecided(a: Mapping[Any, Any], bound: str = "", ending: str = "") -> list[str]:
    """Return summary lines on the shares of undecided and failed starts."""
    words = {"undecided": f"undecided{bound}", "failed": "failed or diverged"}
    shares = [(a[f"{key}{ending}"], word) for key, word in words.items()]
    return [f"{percent(100 * share)} of the starts {word}." for share, word in shares if share > 0]


def effort(a: Mapping[Any, Any]) -> str:
    """Return a summary line on how a result was computed: steps, error, time."""
    return f"{counted(a['steps_per_period'], 'step')} a period, {cost(a)}"


def cost(a: Mapping[Any, Any]) -> str:
    """Return the error and the time of a result as text."""
    time = f"{a['seconds']:.2f} s on {counted(a['threads'], 'thread')} ({a['simd']})"
    return f"error reached {a['reached_error']:.1e}, {time}."


def unlimited_rotation(pendulum: Pendulum) -> list[str]:
    """Return a summary line if viscous damping does not limit the speed of a rotation.

    Over a fast turn gravity, drive and all torques periodic in the angle do no work; the work is
    2 pi torque by the torque and -2 pi theta_r by dry friction, which a drive may balance too.
    """
    sustained = pendulum.p or pendulum.theta_r <= abs(pendulum.torque)
    brakes = pendulum.gamma or any(effect.brakes for effect in pendulum.effects)
    if brakes or not pendulum.theta_r or not sustained:
        return []
    line = "Without viscous damping (gamma = 0) nothing limits a rotation that the torque or the "
    line += "drive sustains: it approaches no attractor, and a smaller --max-periods gives the same"
    return [f"{line} result."]


def window_said(theta: Sequence[float], velocity: Sequence[float], units: Units) -> str:
    """Return a window of starts as text."""
    speeds = units.spoken(f"{velocity[0]:.6g} to {velocity[1]:.6g}")
    return f"theta = {theta[0]:.6g} to {theta[1]:.6g} rad, velocity = {speeds}"


def bound_said(share: float, starts: int) -> str:
    """Return what no start, or every start, tells of the share of the plane; else no text."""
    if 0 < share < 1 or not starts:
        return ""
    most = 100 * missed(starts)
    bound = f"at least {written(100 - most, most)} %" if share else f"at most {percent(most)}"
    return f", {bound} of the plane (95 %)"


def _attractors(dataset: xr.Dataset) -> list[str]:
    """Return a line for each attractor: its share (the basin stability), exponent and twin."""
    lines, a = [], facts(dataset)
    names = dataset["attractor"].values.tolist()
    units = Units.of(a)
    unit = f" {units.of_rate}" if units.si else ""
    columns = ("fraction", "stderr", "twin", "exponent", "exponent_stderr")
    for k, (share, error, twin, exponent, spread) in enumerate(rows(dataset, *columns)):
        mirror = f", mirror image of {names[twin - 1]}" if twin not in {0, k + 1} else ""
        value = f"exponent {with_error(exponent, spread)}{unit}"
        rate = value if math.isfinite(exponent) else "held by friction"
        bound = bound_said(share, a["cells"])
        percentage = f"{100 * share:.2f}" + ("" if bound else f" +- {100 * error:.2f}")
        lines.append(f"{names[k]}: {percentage} % of the starts{bound}, {rate}{mirror}.")
    return lines or ["No attractor was found."]


def _texture(dataset: xr.Dataset) -> list[str]:
    """Return summary lines on how the labels are interwoven."""
    a, lines = facts(dataset), []
    if "theta" not in dataset.dims or a["cells"] == 1:
        return []
    agree, chance = a["neighbours_agree"], a["neighbours_chance"]
    above = (agree - chance) / max(1 - chance, 1e-12)
    verdict = " (hardly better than chance)" if chance < 1 and above < _NEARLY_CHANCE else ""
    lines.append(
        f"Basin entropy {a['basin_entropy']:.3f}; neighbouring cells agree in "
        f"{100 * agree:.1f} %, chance alone gives {100 * chance:.1f} %{verdict}."
    )
    if "boundary_basin_entropy" in a:
        fractal = " is above ln 2 = 0.693: the boundary is fractal (log 2 criterion)"
        verdict = fractal if a["log2_criterion"] else ""
        lines.append(f"Boundary basin entropy {a['boundary_basin_entropy']:.3f}{verdict}.")
    if "uncertainty_exponent" in a:
        value, error = a["uncertainty_exponent"], a["uncertainty_exponent_stderr"]
        ends = [written(a[f"uncertainty_exponent_{end}"], error) for end in ("low", "high")]
        lines.append(
            f"Uncertainty exponent {written(value, error)} [{', '.join(ends)}], boundary dimension "
            f"{written(2 - value, error)}."
        )
    return lines
