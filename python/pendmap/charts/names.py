"""Names of axes and parameters in the units of a result, axes, and charts over two parameters."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from pendmap.charts import plane
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.marks import DOTTED, QUIET, ZERO, Colours, Level, Mark
from pendmap.errors import InputError
from pendmap.formatting import typographic
from pendmap.model import effects_of
from pendmap.model.labels import LABELS, unit_of
from pendmap.model.quantities import COUNTERPARTS
from pendmap.units import VELOCITY, Units

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    import numpy.typing as npt
    import xarray as xr

    from pendmap.charts.marks import Ends, Floats

    Layer = Callable[[str, Ends, Ends], tuple[str, list[Mark]]]

ANGLE: Final = "θ (rad)"  # The angle, with its unit
TIME: Final = "t (s)"  # Time in SI, with its unit
_MOST_COUNT: Final = 8  # Largest count that has its own colour
_TURN: Final = 2.0  # Range of angles above which labels are multiples of pi, rad
_MOSTLY: Final = 95
"""Percentile of absolute values that the linear part of a signed logarithmic axis contains."""
_NEAR: Final = 12.0  # Range of an axis over its linear part up to which it is linear
_WIDE: Final = 8.0  # Ratio of positive values above which their axis is logarithmic
_BARE: Final = ("gamma", "p", "omega", "phase", "torque", "theta_r", "lab_time")
_SI: Final = ("w0", "c_over_m", "p", "stroke_mm", "Omega", "phi", "torque", "Tr", "lab_time_s")
"""Parameters of a nondimensional model and of one in SI, in the order of a subtitle."""
_ALWAYS: Final = ("w0", "gamma", "c_over_m", "p", "omega", "Omega")
"""Parameters in a subtitle even if they are 0."""
_LABORATORY: Final = {"stroke_mm": "p", "frequency_hz": "Omega"}
"""Quantities that a laboratory varies, with the rig parameter that each sets."""


def velocity(units: Units) -> str:
    """Return the symbol of the velocity."""
    return "dθ/dt" if units.si else "dθ/dτ"


def speed(units: Units) -> str:
    """Return the symbol of the velocity with its unit, separated by a blank."""
    return velocity(units) + (" (rad/s)" if units.si else "")


def clock(units: Units) -> str:
    """Return the symbol of time with its unit, separated by a blank."""
    return TIME if units.si else "τ"


def per_time(units: Units) -> str:
    """Return the unit of an exponent in words."""
    return "per second" if units.si else "per unit τ"


def phase_plane(theta: Ends, velocity: Ends, units: Units) -> tuple[Axis, Axis]:
    """Return the axes of the phase plane."""
    return Axis(ANGLE, theta, "angle"), Axis(speed(units), velocity)


def proportion(theta: Ends, velocity: Ends, units: Units) -> float:
    """Return the height of a phase plane over its width, within bounds."""
    low, high = (float(units.bare(bound, VELOCITY)) for bound in velocity)
    return min(max((high - low) / (theta[1] - theta[0]), 0.3), 1.3)


def symbol(name: str, unit: str = "1") -> str:
    """Return the symbol of a parameter with its unit, separated by a blank."""
    mine = LABELS[name].symbol if name in LABELS else name
    return mine if unit in ("", "1") else f"{mine} ({unit})"


def parameters(attrs: Mapping[Any, Any], without: Collection[str] = ()) -> str:
    """Return the model's parameters in one line, in its units, then its effects."""
    without = {_LABORATORY.get(name, name) for name in without}
    driven = float(attrs.get("p", 1.0)) != 0.0 or "p" in without
    units = Units.of(attrs)
    never = without | (set() if driven else {"omega", "phase", "Omega", "phi"})
    never |= {COUNTERPARTS[name][0] for name in without if name in COUNTERPARTS}
    parts = [
        f"{LABELS[key].symbol} = {float(attrs[key]):.6g} {unit_of(key) if units.si else ''}"
        for key in (_SI if units.si else _BARE)
        if key in attrs and key not in never and (key in _ALWAYS or float(attrs[key]) != 0.0)
    ]
    acting = [effect.title(units, without).replace("_", " ") for effect in effects_of(attrs)]
    listed = (",  ".join(part.rstrip() for part in one) for one in (parts, acting) if one)
    return typographic(";   ".join(listed))


def with_start(attrs: Mapping[Any, Any]) -> str:
    """Return the model's parameters and the start of a trajectory in one line."""
    units = Units.of(attrs)
    speed = units.spoken(f"{float(attrs['velocity0']):.6g}")
    start = f"from θ = {float(attrs['theta0']):.6g}, {velocity(units)} = {speed}"
    return f"{parameters(attrs)};   {typographic(start)}"


def seconds(time: Floats) -> Axis:
    """Return the time axis of a record."""
    return Axis(TIME, holding(time, margin=0.01))


def angle(ends: Ends, name: str = ANGLE) -> Axis:
    """Return the axis of an angle or a rate; that of a long range of angles has multiples of pi."""
    return Axis(name, ends, "angle" if name == ANGLE and ends[1] - ends[0] > _TURN else "plain")


def sizes(name: str, *values: npt.ArrayLike) -> Axis:
    """Return an axis of positive values from 0, or a logarithmic one if they differ much."""
    low, high = holding(*values, margin=0.0)
    if high > _WIDE * low > 0:
        return Axis(name, (low / 1.4, 1.5 * high), "log")
    return Axis(name, (0.0, 1.15 * high))


def signed(curves: Sequence[Floats], name: str, *, least: float = 1e-12) -> tuple[Axis, list[Mark]]:
    """Return an axis that is logarithmic on both sides of 0, and lines at its changes of scale."""
    known = [one[np.isfinite(one)] for one in curves]
    known = [one for one in known if np.any(one != 0)]
    if not known:
        return Axis(name, (-1.0, 1.0)), []
    inner = min(float(np.percentile(np.abs(one), _MOSTLY)) for one in known)
    inner = 10.0 ** math.ceil(math.log10(max(inner, least)) - 0.3)
    low, high = min(float(one.min()) for one in known), max(float(one.max()) for one in known)
    if max(-low, high) <= _NEAR * inner:
        return Axis(name, holding([low, high, 0.0])), [ZERO]
    ends = (min(1.5 * low, -1.2 * inner), max(1.5 * high, 1.2 * inner))
    bends = [Level(end, colour=QUIET, width=0.6, dash=DOTTED, order=0.0) for end in (-inner, inner)]
    text = f"{name}\nlog beyond ±{plane.power(inner)}"
    return Axis(text, ends, "signed", straight=inner), [ZERO, *bends]


def parameter_axis(dataset: xr.Dataset, name: str) -> Axis:
    """Return the axis of a parameter, with its unit, as wide as the cells."""
    text = symbol(name, str(dataset[name].attrs.get("units", "1")))
    return Axis(text, plane.outer_edges(dataset, name))


def over(varied: Sequence[str]) -> str:
    """Return the symbols of the parameters that vary, for a title."""
    return " and ".join(symbol(name) for name in varied)


def counts(name: str, values: Floats, least: int = 0) -> Colours:
    """Return the colour scale of whole numbers from ``least`` on."""
    top = int(min(values.max(initial=1), _MOST_COUNT))
    beyond: Literal["max", "neither"] = "max" if values.max(initial=0) > top else "neither"
    ticks = [float(k) for k in range(least, top + 1)]
    return Colours(name, "viridis", least - 0.5, top + 0.5, "counts", beyond, ticks)


def layers(  # noqa: PLR0913, PLR0917 (parts of a chart)
    dataset: xr.Dataset,
    varied: tuple[str, str],
    titles: tuple[str, str],
    make: Layer,
    known: Sequence[str],
    shown: tuple[Sequence[str], Sequence[str]],
    layer: str | None,
) -> Chart:
    """Return a panel of each layer over two parameters, the first one to the right.

    ``make`` returns title and marks of a layer between the ends of both axes. A figure shows
    the first of ``shown``, a recording all; or both the ``layer`` alone, one of those ``known``.
    """
    if layer not in {None, *known}:
        raise InputError(f"no layer {layer!r} in this figure; it has {', '.join(known)}")
    across, up = (plane.outer_edges(dataset, name) for name in varied)
    sides = parameter_axis(dataset, varied[0]), parameter_axis(dataset, varied[1])
    panels = []
    for name in [layer] if layer else [*shown[0], *shown[1]]:
        title, marks = make(name, across, up)
        panels.append(Panel(name, title, *sides, marks))
    return Chart(*titles, [panels[: len(shown[0])]], recorded=panels, ratio=0.85, tabs=True)
