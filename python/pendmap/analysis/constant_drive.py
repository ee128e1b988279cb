"""What of the drive is constant where its frequency varies: the stroke of a shaker, or p."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.result import Field, Found
from pendmap.errors import InputError
from pendmap.model import Rig
from pendmap.model.labels import LABELS
from pendmap.model.quantities import amplitude

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.analysis.varied import Varied
    from pendmap.model import Pendulum

DRIVE: Final = (
    Field("kept", "", "p or stroke_mm: what of the drive is constant where its frequency varies"),
    Found("stroke_mm", "mm", "stroke Y that is constant where the frequency varies", None),
)
"""Fields of an analysis that may vary the frequency of the drive."""


def kept(model: Pendulum | Rig, axes: Sequence[Varied]) -> dict[str, Any]:
    """Return the facts :data:`DRIVE`, None where the frequency is constant or ``p`` varies."""
    every = [one for axis in axes for one in axis.every]
    derived = [one.derived for one in every if one.parameter == "p"]
    if all(one.parameter != "omega" for one in every) or not all(derived):
        return {"kept": None, "stroke_mm": None}
    if derived and isinstance(model, Rig) and model.given_stroke is not None:
        return {"kept": "stroke_mm", "stroke_mm": 1e3 * model.given_stroke}
    return {"kept": "p", "stroke_mm": None}


def summary(model: Pendulum | Rig, axes: Sequence[Varied]) -> list[str]:
    """Return a summary line on what of a rig's drive is constant, if its frequency varies."""
    known = kept(model, axes)
    if known["kept"] is None or not isinstance(model, Rig) or model.p == 0:
        return []
    every = {one.parameter: one for axis in axes for one in axis.every}
    if known["kept"] == "stroke_mm":
        p = every["p"].values
        said = f"p = Y Omega^2/g is {p.min():.4g} to {p.max():.4g}"
        return [f"The stroke Y = {known['stroke_mm']:.4g} mm is constant: {said}."]
    strokes = 1e3 * model.p * model.gravity / (model.w0 * every["omega"].bare) ** 2
    said = f"the stroke Y = p g/Omega^2 is {strokes.max():.4g} to {strokes.min():.4g} mm"
    return [f"p = {model.p:.4g} is constant, as the model gives it: {said}."]


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
    own = next(axis for axis in axes if any(one is omega for one in axis.every))
    apart = varies and not any(one is p for one in own.every)
    scale = {"frequency_hz": math.tau, "omega": model.w0}.get(omega.name, 1.0)
    # Over two axes p is a product: of the stroke in m, and of Omega^2 / g.
    strokes = [model.given_stroke] * omega.bare.size if p is None else 1e-3 * p.values
    each = np.ones(omega.bare.size) if apart else strokes
    both = zip(each, omega.values, strict=True)
    bare = np.array([amplitude(float(y), scale * float(x), model.gravity) for y, x in both])
    new = {"p": dataclasses.replace(p, bare=strokes if apart else bare)} if p is not None else {}
    follows = dataclasses.replace(
        omega,
        name="" if apart else "p",
        values=bare,
        parameter="p",
        bare=bare,
        unit="",
        meaning=LABELS["p"].meaning,
        along=(),
        derived=True,
    )
    found = []
    for axis in axes:
        first, *along = [new.get(one.parameter, one) for one in axis.every]
        if axis is own and (apart or p is None):
            along.append(follows)
        found.append(dataclasses.replace(first, along=tuple(along)))
    return tuple(found)
