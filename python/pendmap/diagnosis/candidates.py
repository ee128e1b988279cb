"""Candidates: effects of the library as a search takes them, nothing about one written here."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError, short_repr
from pendmap.identification.report import DRAG
from pendmap.model.effects import Effect, definition, is_shape, library, middle
from pendmap.model.formula import Formula
from pendmap.model.rig import own_name

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from pendmap.model import Rig
    from pendmap.units import Units

ZERO: Final = "encoder_offset"
"""The sensor's zero: it says nothing of the pendulum, and does not count among the effects."""

CORE: Final = (DRAG, ZERO)
"""What the physical core has beside viscous damping and Coulomb friction."""

COMMON: Final = (*CORE, "encoder_gain", "bias_torque")
"""What nearly every rig has, the commonest first; the library's order holds for all others."""

SCANNED: Final = 6
"""Values of a shape parameter at which a candidate is scored, from the least typical one to the
greatest in equal ratios: neighbouring shapes are then alike to a few percent. Where 0 is typical
too there are no ratios: the middles of as many equal parts."""

SOUGHT: Final = 1000
"""Values of a frequency or an instant among which the residuals choose those that are scored.
Chance may hit each of them."""

MODES: Final = 3
"""Values of a mode's frequency at which a candidate is scored. A fast mode needs short steps."""

PLACES: Final = 9
"""Places on the circle at which a candidate is scored, in equal steps."""

FAINT: Final = 1e-12
"""A size without dimensions at which an effect with a phase is scored: at 0 the phase would do
nothing, and this is far below what any record shows, also where a chaotic motion has made a
million times as much of it: effects are derived in several passes, all about one motion."""


@dataclasses.dataclass(frozen=True)
class Candidate:
    """An effect of the library, or of the user's own, with a shape."""

    name: str  # The effect
    # Values of what is no size and no phase, without dimensions.
    shape: Mapping[str, float] = dataclasses.field(default_factory=dict)
    formula: Formula | None = None  # Where it is the user's own

    @property
    def definition(self) -> dict[str, Any]:
        """What the library, or the formula, says about it."""
        return definition(self.name) if self.formula is None else self.formula.entry

    @property
    def size(self) -> str:
        """The parameter that says how strong it is."""
        return next(str(e["name"]) for e in self.definition["parameters"] if e["role"] == "size")

    @property
    def phase(self) -> str | None:
        """The parameter that is a phase, if it has one."""
        entries = self.definition["parameters"]
        return next((e["name"] for e in entries if e["role"] == "phase"), None)

    @property
    def free(self) -> list[str]:
        """What a fit calls its size and its phase."""
        own = own_name(self.name)
        names = [self.size] if self.phase is None else [self.size, self.phase]
        return [own] if own else [f"{self.name}.{name}" for name in names]

    @property
    def adapted(self) -> list[str]:
        """What a fit calls the parameters of its shape that are adapted with its size.

        Whole numbers are not.
        """
        entries = [e for e in self.definition["parameters"] if e["role"] != "order"]
        return [f"{self.name}.{e['name']}" for e in entries if e["name"] in self.shape]

    @property
    def exponents(self) -> dict[str, str]:
        """The exponents of its shape by the sizes whose units depend on them."""
        return {
            f"{self.name}.{entry['name']}": f"{self.name}.{entry['power_of_w0_less']}"
            for entry in self.definition["parameters"]
            if f"{self.name}.{entry['power_of_w0_less']}" in self.adapted
        }

    @property
    def places(self) -> list[str]:
        """The parameters of its shape that are places, on either side of the rest."""
        entries = self.definition["parameters"]
        return [e["name"] for e in entries if e["name"] in self.shape and e["role"] == "place"]

    @property
    def sought(self) -> dict[str, Any] | None:
        """The parameter that residuals show before any fit: a frequency or an instant."""
        entries = self.definition["parameters"]
        return next((e for e in entries if e["role"] in {"frequency", "instant"}), None)

    @property
    def choices(self) -> int:
        """Among how many values residuals choose its frequency or instant; 1 without one."""
        return SOUGHT if self.sought else 1

    @property
    def looks(self) -> float:
        """Twice the logarithm of the choices: what chance gains by them."""
        return 2 * math.log(self.choices)

    @property
    def once(self) -> bool:
        """Whether it happens once, in one part of the records."""
        return self.sought is not None and self.sought["role"] == "instant"

    @property
    def count(self) -> int:
        """How many numbers are adapted to data when it is chosen."""
        return len(self.free) + len(self.shape)

    def effect(self, units: Units, size: float = 0.0, phase: float = 0.0) -> Effect:
        """Return it with a size (SI) and a phase; where it has a phase never quite without size."""
        bare = dict(self.shape) | {self.size: 0.0}
        if self.phase is not None:
            bare |= {self.size: FAINT, self.phase: phase}
        effect = Effect(self.name, bare, formula=self.formula).given(units)
        if size == 0.0:
            return effect
        return dataclasses.replace(effect, parameters={**effect.parameters, self.size: size})

    @property
    def title(self) -> str:
        """Its name with its shape."""
        shape = ", ".join(f"{name} = {value:.3g}" for name, value in self.shape.items())
        return f"{self.name} ({shape})" if shape else self.name


def choices_of(pool: Collection[Candidate]) -> dict[str, int]:
    """Return by effect among how many of its shapes the best one is chosen."""
    shapes = Counter(candidate.name for candidate in pool)
    return {c.name: max(shapes[c.name], c.choices) for c in pool}


def commonness(effect: str) -> int:
    """Return the place of an effect among all, the commonest first."""
    if effect in COMMON:
        return COMMON.index(effect)
    names = list(library())
    return len(COMMON) + (names.index(effect) if effect in names else len(names))


def placed(model: Rig, added: Sequence[Candidate]) -> Rig:
    """Return a model with candidates in it, at size 0, to be scored or fitted."""
    units = model.units
    effects = [c.effect(units) for c in added if own_name(c.name) is None]
    if not effects:
        return model
    names = {effect.name for effect in effects}
    kept = [effect for effect in model.effects if effect.name not in names]
    # What a drive effect changes stands in each run; the model only needs some frequency.
    omega = model.Omega or float(any(effect.drives for effect in effects))
    return dataclasses.replace(model, effects=(*kept, *effects), Omega=omega)


def checked_own(effects: Sequence[object]) -> tuple[Formula, ...]:
    """Return a user's own candidates.

    Raises
    ------
    InputError
        If one is no formula, is there twice, or is not proportional to its first parameter.
    """
    formulas = []
    for effect in effects:
        if not isinstance(effect, Formula):
            raise InputError(
                "effects must be a Formula, like Formula('mine', '-k*v^5', {'k': -3}), got "
                f"{short_repr(effect)}"
            )
        if not effect.proportional:
            size = effect.entry["parameters"][0]["name"]
            raise InputError(
                f"formula '{effect.name}' is not proportional to its first parameter {size}: "
                "the first parameter of a candidate must be the size of its term"
            )
        formulas.append(effect)
    names = [formula.name for formula in formulas]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InputError(f"effects must have each name once, it has {twice[0]} twice")
    return tuple(formulas)


def candidates(
    taken: Collection[str],
    *,
    driven: bool,
    without: Collection[str] = (),
    own: Collection[Formula] = (),
) -> list[list[Candidate]]:
    """Return the candidates that records may show, by effect, each in all its shapes.

    ``taken`` are effects that the model has already and parameters of a :class:`Rig` that are free:
    an effect that says the same as one of them is left out, as are those of ``without``. Effects of
    the drive need runs with a harmonic drive; ``own`` are the user's own.
    """
    formulas = {formula.name: formula for formula in own}
    found = []
    entries = library() | {name: formula.entry for name, formula in formulas.items()}
    for name, entry in entries.items():
        if name in taken or name in without or own_name(name) in taken:
            continue
        if entry["group"] == "drive" and not driven:
            continue
        found.append([Candidate(name, shape, formulas.get(name)) for shape in _shapes(entry)])
    return found


def _shapes(entry: Mapping[str, Any]) -> Iterator[dict[str, float]]:
    """Yield the shapes of an effect: one parameter at most is scanned."""
    shapes = [e for e in entry["parameters"] if is_shape(e)]
    if not shapes:
        yield {}
        return
    first, *others = shapes
    fixed = {e["name"]: middle(e) for e in others}
    for value in _scan(first):
        yield {first["name"]: float(value)} | fixed


def _scan(entry: Mapping[str, Any]) -> NDArray[np.float64]:
    low, high = entry["typical"]
    if entry["role"] == "order":
        return np.arange(round(low), round(high) + 1.0)
    if entry["role"] == "place":
        return np.linspace(low, high, PLACES)
    if entry["role"] in {"frequency", "instant"}:
        return np.array([high])  # residuals show it
    if low > 0:
        return np.geomspace(low, high, MODES if entry["role"] == "mode" else SCANNED)
    width = (high - low) / SCANNED
    return np.linspace(low + 0.5 * width, high - 0.5 * width, SCANNED)
