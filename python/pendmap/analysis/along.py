"""Parameters along one dimension, and what of the drive is constant there: stroke or p."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.grid import coordinate, evenly
from pendmap.analysis.result import Field, Found
from pendmap.errors import InputError
from pendmap.files.variables import variable
from pendmap.formatting import span
from pendmap.model import Rig
from pendmap.model.labels import LABELS
from pendmap.model.quantities import COUNTERPARTS, amplitude

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.model import Pendulum
    from pendmap.signal import Floats

DRIVE: Final = (
    Field("kept", "", "p or stroke_mm: what of the drive is constant where its frequency varies"),
    Found("stroke_mm", "mm", "stroke Y that is constant where the frequency varies", None),
)
"""Fields of an analysis that may vary the frequency of the drive."""


@dataclasses.dataclass(frozen=True)
class Varied:
    """A parameter and its values: ascending, evenly spaced unless they were listed."""

    name: str
    """Name of the parameter, one of those of :func:`pendmap.parameter_map`."""
    values: Floats
    """Values in the units of the parameter."""
    parameter: str
    """Name of the parameter in the core."""
    bare: Floats
    """The values without dimensions."""
    unit: str
    """Unit of the values; empty where they have none."""
    meaning: str
    """Meaning of the parameter."""
    along: tuple[Varied, ...] = ()
    """Parameters that vary with it, on the same dimension."""
    derived: bool = False
    """Whether it follows from a constant stroke; a factor of ``p`` of another axis has no name."""

    @property
    def every(self) -> tuple[Varied, ...]:
        """All parameters of the dimension."""
        return (self, *self.along)

    @property
    def kernel(self) -> list[tuple[str, list[float]]]:
        """Names and values as passed to the core."""
        return [(one.parameter, one.bare.tolist()) for one in self.every]

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of a quantity with these values."""
        return variable((), 0.0, self.unit or "1", self.meaning)[2]

    @property
    def coordinates(self) -> dict[str, Any]:
        """Coordinates of a dataset; those of several values of the first also have bounds."""
        x = self.values
        more = {one.name: (self.name, one.values, one.attributes) for one in self.along if one.name}
        known = {one.parameter: one for one in self.every}
        if "omega" in known and "p" in known and known["p"].name == "stroke_mm":
            more["p"] = self.name, known["p"].bare, variable((), 0.0, "1", LABELS["p"].meaning)[2]
        if x.size == 1:
            return {self.name: (self.name, x, self.attributes), **more}
        if self.even:
            half = 0.5 * (x[-1] - x[0]) / (x.size - 1)
            edges = np.linspace(x[0] - half, x[-1] + half, x.size + 1)
        else:
            middle = 0.5 * (x[1:] + x[:-1])
            edges = np.array([2 * x[0] - middle[0], *middle, 2 * x[-1] - middle[-1]])
        return {**coordinate(self.name, x, edges, **self.attributes), **more}

    @property
    def even(self) -> bool:
        """Whether the values are evenly spaced."""
        return evenly(self.values)

    @property
    def replaced(self) -> tuple[str, ...]:
        """Names of the model's own parameters that these replace."""
        names = [one.parameter for one in self.every]
        return (*names, *(COUNTERPARTS[name][0] for name in names if name in COUNTERPARTS))


def kept(model: Pendulum | Rig, axes: Sequence[Varied]) -> dict[str, Any]:
    """Return the facts :data:`DRIVE`, None where the frequency is constant or ``p`` varies."""
    every = [one for axis in axes for one in axis.every]
    derived = [one.derived for one in every if one.parameter == "p"]
    if all(one.parameter != "omega" for one in every) or not all(derived):
        return {"kept": None, "stroke_mm": None}
    if derived and isinstance(model, Rig) and model.given_stroke is not None:
        return {"kept": "stroke_mm", "stroke_mm": 1e3 * model.given_stroke}
    return {"kept": "p", "stroke_mm": None}


def drive_said(model: Pendulum | Rig, axes: Sequence[Varied]) -> list[str]:
    """Return a summary line on what of a rig's drive is constant, if its frequency varies."""
    known = kept(model, axes)
    if known["kept"] is None or not isinstance(model, Rig) or model.p == 0:
        return []
    if known["kept"] == "stroke_mm":
        p = next(one.values for axis in axes for one in axis.every if one.parameter == "p")
        stroke = span("The stroke Y", *[known["stroke_mm"]] * 2)
        return [f"{stroke} mm is constant: {span('p', p.min(), p.max())} by p = Y Omega^2/g."]
    return [f"{span('p', model.p, model.p)} is constant, as the model gives it: not the stroke."]


def with_stroke(model: Pendulum | Rig, axes: tuple[Varied, ...]) -> tuple[Varied, ...]:
    """Return axes with ``p`` where the frequency varies and the stroke is given, or varies too."""
    every = {one.parameter: one for axis in axes for one in axis.every}
    omega, p = every.get("omega"), every.get("p")
    varies = p is not None and p.name == "stroke_mm"
    if not isinstance(model, Rig) or not (varies or (p is None and model.given_stroke is not None)):
        return axes
    if omega is None:
        if varies and model.Omega == 0:
            raise InputError("stroke_mm needs a frequency: Omega or frequency_hz must be given")
        return axes
    omega_axis = next(axis for axis in axes if any(one is omega for one in axis.every))
    apart = varies and not any(one is p for one in omega_axis.every)
    scale = {"frequency_hz": math.tau, "omega": model.w0}.get(omega.name, 1.0)
    # Over two axes p is a product: of the stroke in m, and of Omega^2 / g.
    given = np.full(omega.values.size, model.given_stroke or 0.0)
    metres = given if p is None else 1e-3 * p.values
    both = zip(np.ones(omega.values.size) if apart else metres, omega.values, strict=True)
    bare = np.array([amplitude(float(y), scale * float(x), model.gravity) for y, x in both])
    new = {} if p is None else {"p": dataclasses.replace(p, bare=metres if apart else bare)}
    named, follows = (
        ("" if apart else "p", bare, "p", bare, "", LABELS["p"].meaning),
        apart or not p,
    )
    new_axes = []
    for axis in axes:
        first, *along = [new.get(one.parameter, one) for one in axis.every]
        more = [Varied(*named, derived=True)] if axis is omega_axis and follows else []
        new_axes.append(dataclasses.replace(first, along=(*along, *more)))
    return tuple(new_axes)
