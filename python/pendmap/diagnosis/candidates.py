"""Candidates: effects of the library or of the user, each with a shape."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError, short_repr
from pendmap.identification.methods.trajectory import DRAG
from pendmap.model.effects import Effect, definition, library
from pendmap.model.formula import Formula
from pendmap.model.rig import own_name

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from pendmap.model import Rig
    from pendmap.model.effects import EffectDefinition, EffectParameter
    from pendmap.signal import Floats
    from pendmap.units import Units

ZERO: Final = "encoder_offset"
"""The sensor's zero: it is no property of the pendulum and is not counted among the effects."""

CORE: Final = (DRAG, ZERO)
"""Effects of the physical core in addition to viscous damping and Coulomb friction."""

COMMON: Final = (*CORE, "encoder_gain", "bias_torque")
"""Effects of nearly every rig, the commonest first; all others follow in the library's order."""

SCANNED: Final = 6
"""Number of scored values of a shape parameter, in equal ratios over its typical range, or in the
middles of equal parts of a range that includes 0."""

SOUGHT: Final = 1000
"""Number of frequencies or instants among which residuals choose those that are scored."""

MODES: Final = 3  # Number of scored frequencies of a mode; a fast mode needs short steps

PLACES: Final = 9  # Number of scored places on the circle, in equal steps

FAINT: Final = 1e-12
"""Nondimensional size at which an effect with a phase is scored: not 0, and far below what any
record shows, even after growth by a factor of a million in chaotic motion."""


@dataclasses.dataclass(frozen=True)
class Candidate:
    """An effect of the library or of the user, with a shape."""

    name: str  # Name of the effect
    # Values of parameters that are neither size nor phase, nondimensional.
    shape: Mapping[str, float] = dataclasses.field(default_factory=dict)
    formula: Formula | None = None  # Of the user's own effect

    @property
    def definition(self) -> EffectDefinition:
        """Entry of the library, or of the formula."""
        return definition(self.name) if self.formula is None else self.formula.definition

    def _of_role(self, *roles: str) -> list[EffectParameter]:
        return [entry for entry in self.definition.parameters if entry.role in roles]

    @property
    def size(self) -> str:
        """Name of the parameter that is the size."""
        return self._of_role("size")[0].name

    @property
    def phase(self) -> str | None:
        """Name of the parameter that is a phase, if any."""
        return next((entry.name for entry in self._of_role("phase")), None)

    @property
    def free(self) -> list[str]:
        """Names of its size and phase in a fit."""
        parameter = own_name(self.name)
        names = [self.size] if self.phase is None else [self.size, self.phase]
        return [parameter] if parameter else [f"{self.name}.{name}" for name in names]

    @property
    def adapted(self) -> list[str]:
        """Names in a fit of the shape parameters fitted with its size, without integers."""
        orders = [entry.name for entry in self._of_role("order")]
        return [f"{self.name}.{name}" for name in self.shape if name not in orders]

    @property
    def exponents(self) -> dict[str, str]:
        """Exponents of its shape, by the sizes whose units depend on them."""
        less = {e.name: e.power_of_w0_less for e in self.definition.parameters}
        pairs = {f"{self.name}.{size}": f"{self.name}.{power}" for size, power in less.items()}
        return {size: power for size, power in pairs.items() if power in self.adapted}

    @property
    def places(self) -> list[str]:
        """Shape parameters that are places, on either side of the rest position."""
        return [entry.name for entry in self._of_role("place")]

    @property
    def sought(self) -> EffectParameter | None:
        """Entry of the frequency or instant that residuals show before any fit."""
        return next(iter(self._of_role("frequency", "instant")), None)

    @property
    def choices(self) -> int:
        """Number of values among which residuals choose its frequency or instant; else 1."""
        return SOUGHT if self.sought else 1

    @property
    def choice_gain(self) -> float:
        """Twice the logarithm of the choices: the gain of choosing the best by chance."""
        return 2 * math.log(self.choices)

    @property
    def once(self) -> bool:
        """Whether it acts once, in one part of the records."""
        return self.sought is not None and self.sought.role == "instant"

    @property
    def plain(self) -> bool:
        """Whether it is the zero, the scale or the clock of a sensor."""
        clock = self.definition.group == "drive" and self.definition.family == "reading"
        return clock or self.name in {ZERO, "encoder_gain"}

    @property
    def count(self) -> int:
        """Number of parameters that are fitted or scanned."""
        return len(self.free) + len(self.shape)

    def effect(self, units: Units, size: float = 0.0) -> Effect:
        """Return the effect with a nondimensional size; with a phase the size is never 0."""
        bare = dict(self.shape) | {self.size: size}
        if self.phase is not None:
            bare |= {self.size: size or FAINT, self.phase: 0.0}
        return Effect(self.name, bare, formula=self.formula).given(units)

    def shape_in(self, units: Units) -> dict[str, float]:
        """Return its shape in these units."""
        given = self.effect(units).parameters if self.shape else {}
        return {name: given[name] for name in self.shape}


def count_choices(pool: Collection[Candidate]) -> dict[str, int]:
    """Return the number of shapes to choose from, by effect."""
    shapes = Counter(candidate.name for candidate in pool)
    return {c.name: max(shapes[c.name], c.choices) for c in pool}


def commonness(effect: str) -> int:
    """Return the rank of an effect, the commonest first."""
    if effect in COMMON:
        return COMMON.index(effect)
    names = list(library())
    return len(COMMON) + (names.index(effect) if effect in names else len(names))


def add_candidates(model: Rig, added: Sequence[Candidate]) -> Rig:
    """Return a model with candidates of size 0."""
    units = model.units
    effects = [c.effect(units) for c in added if own_name(c.name) is None]
    if not effects:
        return model
    names = {effect.name for effect in effects}
    others = [effect for effect in model.effects if effect.name not in names]
    # Runs have their own drives; the model only needs some frequency.
    omega = model.Omega or float(any(effect.drives for effect in effects))
    return dataclasses.replace(model, effects=(*others, *effects), Omega=omega)


def checked_own(effects: Sequence[object]) -> tuple[Formula, ...]:
    """Return a user's own candidates after checks.

    Raises InputError if one is not a Formula, is given twice, or is not proportional to its first
    parameter.
    """
    if not isinstance(effects, list | tuple):
        raise InputError(f"effects must be a list of Formula, got {short_repr(effects)}")
    formulas = []
    for effect in effects:
        if not isinstance(effect, Formula):
            raise InputError(
                "effects must be a Formula, like Formula('mine', '-k*v^5', {'k': -3}), got "
                f"{short_repr(effect)}"
            )
        if not effect.proportional:
            size = effect.definition.parameters[0].name
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


def list_candidates(
    taken: Collection[str],
    *,
    driven: bool,
    without: Collection[str] = (),
    user_formulas: Collection[Formula] = (),
    reach: float = math.inf,
) -> list[list[Candidate]]:
    """Return the candidates by effect, each in all its shapes.

    Effects equivalent to those in ``taken`` (names of effects and of a Rig's fitted parameters) and
    those in ``without`` are left out. Effects of the drive need a harmonic drive, and a wave over
    the angle one wavelength within the range of angles ``reach``, rad: else it is a spring.
    """
    formulas = {formula.name: formula for formula in user_formulas}
    candidates = []
    entries = library() | {name: formula.definition for name, formula in formulas.items()}
    for name, entry in entries.items():
        if name in taken or name in without or own_name(name) in taken:
            continue
        if entry.group == "drive" and not driven:
            continue
        waves = {e.name for e in entry.parameters if e.role == "order"}
        varied = [e for e in entry.parameters if e.is_shape]
        fixed = {e.name: e.middle for e in varied}
        # At most one parameter is scanned.
        shapes = [fixed | {e.name: float(v)} for e in varied[:1] for v in _scan(e)] or [fixed]
        shapes = [s for s in shapes if all(math.tau <= s[n] * reach for n in waves)]
        if shapes:
            candidates.append([Candidate(name, shape, formulas.get(name)) for shape in shapes])
    return candidates


def _scan(entry: EffectParameter) -> Floats:
    """Return the scored values of a shape parameter, nondimensional."""
    low, high = entry.typical
    if entry.role == "order":
        return np.arange(round(low), round(high) + 1.0)
    if entry.role == "place":
        return np.linspace(low, high, PLACES)
    if entry.role in {"frequency", "instant"}:
        return np.array([high])  # a placeholder: residuals show the value
    if low > 0:
        return np.geomspace(low, high, MODES if entry.role == "mode" else SCANNED)
    width = (high - low) / SCANNED
    return np.linspace(low + 0.5 * width, high - 0.5 * width, SCANNED)
