"""Candidates: effects of the library as a search takes them, nothing about one written here."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.model.effects import Effect, definition, library
from pendmap.model.rig import COUNTERPARTS

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from numpy.typing import NDArray

    from pendmap.model import Rig
    from pendmap.model.units import Units

__all__ = ["Candidate", "candidates", "own_name", "place"]

SCANNED: Final = 6
"""Values of a shape parameter at which a candidate is scored, from the least typical one to the
greatest in equal ratios: neighbouring shapes are then alike to a few percent."""

PLACES: Final = 9
"""The same of a place on the circle, in equal steps."""

FAINT: Final = 1e-7
"""A size without dimensions at which an effect with a phase is scored: at 0 the phase would do
nothing, and this is far below what any record shows."""

TURN: Final = 6.0
"""A parameter whose typical range is at least this wide around 0 is a phase, rad."""


@dataclasses.dataclass(frozen=True)
class Candidate:
    """An effect of the library with a shape.

    Parameters
    ----------
    name : str
        The effect.
    shape : mapping of str to float
        Values of what is no size and no phase, without dimensions.
    """

    name: str
    shape: Mapping[str, float] = dataclasses.field(default_factory=dict)

    @property
    def size(self) -> str:
        """The parameter that says how strong it is: the library's first."""
        return str(definition(self.name)["parameters"][0]["name"])

    @property
    def phase(self) -> str | None:
        """The parameter that is a phase, if it has one."""
        return next((e["name"] for e in definition(self.name)["parameters"] if _turns(e)), None)

    @property
    def free(self) -> list[str]:
        """What a fit calls its size and its phase."""
        own = own_name(self.name)
        names = [self.size] if self.phase is None else [self.size, self.phase]
        return [own] if own else [f"{self.name}.{name}" for name in names]

    @property
    def adapted(self) -> list[str]:
        """What a fit calls the parameters of its shape that are adapted with its size.

        Whole numbers are not, nor what the unit of the size depends on.
        """
        entries = definition(self.name)["parameters"]
        less = {e["power_of_w0_less"] for e in entries}
        return [
            f"{self.name}.{e['name']}"
            for e in entries
            if e["name"] in self.shape and e["name"] not in less and not _whole(e)
        ]

    @property
    def counts_turns(self) -> bool:
        """Whether its shape is a whole number, of periods a turn."""
        entries = definition(self.name)["parameters"]
        return any(_whole(e) for e in entries if e["name"] in self.shape)

    @property
    def count(self) -> int:
        """How many numbers are adapted to data when it is chosen."""
        return len(self.free) + len(self.shape)

    def effect(self, units: Units, size: float = 0.0, phase: float = 0.0) -> Effect:
        """Return it with a size (SI) and a phase; where it has a phase never quite without size."""
        bare = dict(self.shape) | {self.size: 0.0}
        if self.phase is not None:
            bare |= {self.size: FAINT, self.phase: phase}
        effect = Effect(self.name, bare).given(units)
        if size == 0.0:
            return effect
        return dataclasses.replace(effect, parameters={**effect.parameters, self.size: size})

    @property
    def title(self) -> str:
        """Its name with its shape."""
        shape = ", ".join(f"{name} = {value:.3g}" for name, value in self.shape.items())
        return f"{self.name} ({shape})" if shape else self.name


def own_name(effect: str) -> str | None:
    """Return the parameter of a :class:`pendmap.Rig` that says the same as an effect, if any."""
    entries = definition(effect)["parameters"]
    known = COUNTERPARTS.get(entries[0]["name"])
    return known[0] if len(entries) == 1 and known is not None else None


def place(model: Rig, candidate: Candidate) -> Rig:
    """Return a model with a candidate in it, at size 0, to be scored or fitted."""
    if own_name(candidate.name) is not None:
        return model
    kept = tuple(effect for effect in model.effects if effect.name != candidate.name)
    driven = candidate.effect(model.units)
    # What a drive effect changes stands in each run; the model only needs some frequency.
    omega = model.Omega or (1.0 if driven.drives else 0.0)
    return dataclasses.replace(model, effects=(*kept, driven), Omega=omega)


def candidates(
    taken: Collection[str], *, driven: bool, without: Collection[str] = ()
) -> list[list[Candidate]]:
    """Return the candidates that records may show, by effect, each in all its shapes.

    Parameters
    ----------
    taken : collection of str
        Effects that the model has already, and parameters of a :class:`pendmap.Rig` that are free:
        an effect that says the same as one of them is left out.
    driven : bool
        Whether there are runs with a harmonic drive; effects of the drive need one.
    without : collection of str
        Effects that are left out besides.
    """
    found = []
    for name, entry in library().items():
        if name in taken or name in without or own_name(name) in taken:
            continue
        if entry["group"] == "drive" and not driven:
            continue
        found.append([Candidate(name, shape) for shape in _shapes(entry)])
    return found


def _shapes(entry: Mapping[str, Any]) -> Iterator[dict[str, float]]:
    """Yield the shapes of an effect: one parameter at most is scanned."""
    shapes = [e for e in entry["parameters"][1:] if not _turns(e)]
    if not shapes:
        yield {}
        return
    first, *others = shapes
    fixed = {e["name"]: math.sqrt(e["typical"][0] * e["typical"][1]) for e in others}
    for value in _scan(*first["typical"], whole=_whole(first)):
        yield {first["name"]: float(value)} | fixed


def _scan(low: float, high: float, *, whole: bool) -> NDArray[np.float64]:
    if whole:
        return np.arange(low, high + 0.5)
    if low < 0:
        return np.linspace(low, high, PLACES)  # a place on the circle
    return np.geomspace(low, high, SCANNED)


def _turns(entry: Mapping[str, Any]) -> bool:
    low, high = entry["typical"]
    return bool(entry["unit"] == "rad" and low < 0 < high and high - low > TURN)


def _whole(entry: Mapping[str, Any]) -> bool:
    """Whether a shape is a number of periods: its range is of whole numbers."""
    low, high = entry["typical"]
    return bool(entry["unit"] == "1" and float(low).is_integer() and float(high).is_integer())
