"""Summary of a basin map, and lines common to several summaries."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.analysis.grid import FASTEST
from pendmap.analysis.orbit_table import chaotic
from pendmap.analysis.result import missed, of_model, rows
from pendmap.files import facts
from pendmap.formatting import counted, percent, with_error, written
from pendmap.model.pendulum import effects_of, is_driven
from pendmap.units import TIME, VELOCITY, Units

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from pendmap.model import Pendulum


_NEARLY_CHANCE = 0.15  # Agreement of neighbours above chance, below which it is hardly better


def summarise(
    dataset: xr.Dataset, pendulum: Pendulum, *, bound_was_chosen: bool, decided: int, moving: int
) -> str:
    """Return the summary of a basin map whose facts are set, one sentence a line.

    ``decided`` starts end on an attractor; ``moving`` undecided ones do not start at rest.
    """
    a, plane = facts(dataset), dataset.attrs["plane"]
    unlimited = unlimited_rotation(pendulum)
    if plane == "conservative":
        line = (
            "Without damping (gamma = 0) phase area is kept and there are no attractors: net turns "
            "and the finite-time exponent after "
            f"{counted(a['layer_periods'], 'period')} are shown instead."
        )
        lines = [line]
    elif plane == "only_chaos":
        lines = [_only_chaos(dataset)]
    else:
        lines = [*_attractors(dataset), *_settling(dataset), *_texture(dataset, decided)]
    for key, word in (("undecided", "undecided"), ("failed", "failed or diverged")):
        share = a[key]
        if share > 0 and plane != "conservative":
            bound = _bound(dataset, moving, chosen=bound_was_chosen) if key == "undecided" else ""
            bound = bound.split(";")[0] if unlimited else bound  # a larger bound does not help
            lines.append(f"{100 * share:.3g} % of the starts {word}{bound}.")
    if "theta" in dataset.dims:
        theta, velocity = (
            tuple(dataset[f"{name}_bounds"].values[[0, -1], [0, 1]])
            for name in ("theta", "velocity")
        )
        window = window_said(theta, velocity, Units.of(a))
        lines.insert(0, f"{window}: {counted(a['cells'], 'start')}.")
    if plane != "conservative":
        lines += unlimited
        if not unlimited and a["undecided"] > 0 and _dry(pendulum)[0] > 0 and pendulum.p:
            lines.append(
                "With dry friction alone (gamma = 0) phase area shrinks only where the motion "
                "turns back: a rotation sustained by the drive approaches no attractor."
            )
    lines += of_model(pendulum, "this map is")
    lines.append(
        f"{counted(a['cells'], 'start')}, {a['mean_periods']:.1f} periods each on average, "
        f"{effort(a)}"
    )
    return "\n".join(lines)


def effort(a: Mapping[Any, Any]) -> str:
    """Return a summary line on how a result was computed: steps, error, time."""
    return (
        f"{counted(a['steps_per_period'], 'step')} a period, error reached "
        f"{a['reached_error']:.1e}, {a['seconds']:.2f} s on {counted(a['threads'], 'thread')} "
        f"({a['simd']})."
    )


def unlimited_rotation(pendulum: Pendulum) -> list[str]:
    """Return summary lines if nothing limits the speed of a rotation, so that it never settles.

    Over a fast turn gravity, drive and all torques periodic in the angle do no work. Without terms
    that grow with speed, the work is 2 pi torque by the torque and -2 pi theta_r by dry friction.
    """
    friction, torque = _dry(pendulum)
    if torque == 0 or not 0 < friction <= abs(torque):
        return []
    way = "forward" if torque > 0 else "backward"
    lines = [
        f"Without viscous damping (gamma = 0) nothing limits a rotation {way}: a turn gains "
        f"2 pi ({abs(torque):g} - {friction:g}) m l^2 w0^2 by torque less friction, so that it "
        + ("accelerates without bound" if abs(torque) > friction else "keeps its energy")
        + " and reaches no attractor. A smaller --max-periods gives the same result."
    ]
    if abs(torque) > friction + 1 + abs(pendulum.p):
        lines.append(
            "Friction holds it at no angle (torque above theta_r + 1 + p): no start rests."
        )
    return lines


def _dry(pendulum: Pendulum) -> tuple[float, float]:
    """Return dry friction and torque; nan if other damping acts."""
    kinds = {effect.name for effect in pendulum.effects if effect.brakes}
    fields = {"viscous_damping": "gamma", "coulomb_friction": "theta_r", "bias_torque": "torque"}
    added = dict.fromkeys(fields.values(), 0.0)
    for effect in pendulum.effects:
        if effect.name in fields:
            added[fields[effect.name]] = next(iter(effect.parameters.values()))
    gamma, friction, torque = (
        getattr(pendulum, name) + added[name] for name in ("gamma", "theta_r", "torque")
    )
    # Stribeck friction's extra part vanishes at speed; all other damping may brake a rotation.
    if gamma > 0 or kinds - {"coulomb_friction", "stribeck_friction", "viscous_damping"}:
        return math.nan, math.nan
    return friction, torque


def _bound(dataset: xr.Dataset, moving: int, *, chosen: bool) -> str:
    """Return the bound after which a start is undecided, as text, and what raises it."""
    if not moving and facts(dataset)["torque"] == 0 and not effects_of(dataset.attrs):
        return ": they start exactly at an unstable equilibrium and stay there"
    text = f" within {counted(dataset.attrs['max_periods'], 'period')}"
    if chosen and chaotic(dataset).any():
        text += " (where chaos coexists, ten times the longest settling seen, at least 200)"
    return f"{text}; --max-periods raises this bound"


def window_said(theta: tuple[float, ...], velocity: tuple[float, ...], units: Units) -> str:
    """Return a window of starts as text, with a note if it is the default one."""
    usual = (math.pi, units.given(FASTEST, VELOCITY))
    default = all(
        np.allclose(span, (-reach, reach), rtol=1e-12)
        for span, reach in zip((theta, velocity), usual, strict=True)
    )
    (low, high), (slow, fast) = theta, velocity
    speeds = units.spoken(f"{slow:.6g} to {fast:.6g}")
    note = f" (the default window{', to 3 w0' if units.si else ''})" if default else ""
    return f"theta = {low:.6g} to {high:.6g} rad, velocity = {speeds}{note}"


def box_said(attrs: Mapping[Any, Any]) -> str:
    """Return the box of the starts of a search over many pendulums as text."""
    theta, velocity = (
        (float(attrs[f"low_{name}"]), float(attrs[f"high_{name}"]))
        for name in ("theta", "velocity")
    )
    return f"in {window_said(theta, velocity, Units.of(attrs))}"


def _only_chaos(dataset: xr.Dataset) -> str:
    a = dataset.attrs
    name = str(dataset["attractor"].values[0])
    exponent, error = (float(dataset[k].values[0]) for k in ("exponent", "exponent_stderr"))
    most = 100 * missed(a["searched_starts"])
    return (
        f"One chaotic attractor captures all starts: {name}, exponent "
        f"{with_error(exponent, error)} {Units.of(a).per_time}; no sampled trajectory "
        f"settled within {a['chaos_bound']} periods. All {a['searched_starts']} sampled starts "
        f"end there: another attractor has at most {most:.2g} % of them (95 %).\n"
        "Labels carry no information here: net turns and the finite-time exponent after "
        f"{counted(a['layer_periods'], 'period')} are shown instead."
    )


def _attractors(dataset: xr.Dataset) -> list[str]:
    lines = []
    names = dataset["attractor"].values.tolist()
    units = Units.of(facts(dataset))
    unit = f" {units.of_rate}" if units.si else ""
    starts = facts(dataset)["cells"]
    columns = ("fraction", "stderr", "twin", "exponent", "exponent_stderr")
    for k, (share, error, twin, exponent, spread) in enumerate(rows(dataset, *columns)):
        mirror = f", mirror image of {names[twin - 1]}" if twin not in {0, k + 1} else ""
        value = f"exponent {with_error(exponent, spread)}{unit}"
        rate = value if math.isfinite(exponent) else "held by friction"
        bound = bound_said(share, starts)
        percentage = f"{100 * share:.2f}" + ("" if bound else f" +- {100 * error:.2f}")
        lines.append(f"{names[k]}: {percentage} % of the starts{bound}, {rate}{mirror}.")
    if len(lines) > 1:
        lines.append("These shares are the basin stability in this window.")
    if not lines:
        lines.append("No attractor was found.")
    return lines


def bound_said(share: float, starts: int) -> str:
    """Return what no start, or every start, tells of the share of the plane; else no text."""
    if 0 < share < 1 or not starts:
        return ""
    most = 100 * missed(starts)
    bound = f"at least {written(100 - most, most)} %" if share else f"at most {percent(most)}"
    return f", {bound} of the plane (95 %)"


def _settling(dataset: xr.Dataset) -> list[str]:
    a = facts(dataset)
    if a["longest_settle"] < 0:
        return []
    note, units = "", Units.of(a)
    if not is_driven(a["p"], effects_of(a)):
        time = f" = {units.given(math.tau, TIME):.4g} s" if units.si else ""
        note = f" (without drive a period is {units.own_period}{time})"
    times = f"{a['mean_settle']:.1f} periods on average, {a['longest_settle']} at most"
    return [f"Settling takes {times}{note}."]


def _boundary(attrs: Mapping[Any, Any]) -> list[str]:
    """Return summary lines on the fractality of the boundary."""
    lines = []
    if "boundary_basin_entropy" in attrs:
        value = attrs["boundary_basin_entropy"]
        line = f"Boundary basin entropy {value:.3f}"
        if attrs["log2_criterion"]:
            line += " is above ln 2 = 0.693: the boundary is fractal (log 2 criterion)"
        lines.append(f"{line}.")
    if "uncertainty_exponent" in attrs:
        value, error = attrs["uncertainty_exponent"], attrs["uncertainty_exponent_stderr"]
        low, high = (attrs[f"uncertainty_exponent_{end}"] for end in ("low", "high"))
        value, low, high, dimension = (
            written(number, error) for number in (value, low, high, 2 - value)
        )
        near, far = attrs["uncertainty_eps_low"], attrs["uncertainty_eps_high"]
        lines.append(
            f"Uncertainty exponent {value} [{low}, {high}], boundary dimension {dimension}, from "
            f"distances of {near:.1e} to {far:.1e} of the window."
        )
    return lines


def _texture(dataset: xr.Dataset, decided: int) -> list[str]:
    a = facts(dataset)
    if not decided:
        return []  # no label is decided: agreement has no meaning
    lines = []
    if "theta" in dataset.dims and a["cells"] > 1:
        agree, chance = a["neighbours_agree"], a["neighbours_chance"]
        above = (agree - chance) / max(1 - chance, 1e-12)
        verdict = " (hardly better than chance)" if chance < 1 and above < _NEARLY_CHANCE else ""
        lines.append(
            f"Basin entropy {a['basin_entropy']:.3f}; neighbouring cells agree in "
            f"{100 * agree:.1f} %, chance alone gives {100 * chance:.1f} %{verdict}."
        )
        lines += _boundary(a)
    if a["labels_sampled"]:
        halved = f"half the step changes {100 * a['unreliable_half_step']:.1f} %"
        mirror = a.get("unreliable_mirror")
        mirrored = "" if mirror is None else f", mirroring {100 * mirror:.1f} %"
        lines.append(f"Of {a['labels_sampled']} sampled labels {halved}{mirrored}.")
    if not a["labels_reliable"]:
        lines.append(
            f"LABELS OF SINGLE CELLS ARE NOT RELIABLE HERE ({100 * a['unreliable']:.1f} % change): "
            "read the shares, the settling time and the net turns."
        )
        twins = dataset["twin"].values
        if any(t not in {0, k + 1} for k, t in enumerate(twins)):
            lines.append("Mirror images have equal shares by symmetry.")
    return lines
