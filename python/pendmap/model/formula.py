"""Effects defined by the user: a torque as a formula."""

from __future__ import annotations

import dataclasses
import math
import os
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from pendmap.errors import InputError, check_keys, check_number, core_errors, named, short_repr
from pendmap.files import read_toml
from pendmap.model.effects import Effect, EffectDefinition
from pendmap.model.quantities import BARE_KEYS, SI_KEYS

if TYPE_CHECKING:
    from collections.abc import Iterator


FORMULA: Final = ("name", "term", "parameters", "revealed_by")
PARAMETER: Final = ("power", "role", "typical", "range", "unit", "meaning")
_EXAMPLES: Final = {"name": '"cubic"', "term": '"-k*v^3"', "parameters": "{ k = -1 }"}
"""Keys that a formula needs, with examples for messages."""
_TYPICAL: Final = (1e-4, 0.3)  # Default range of interest: that of the library's sizes
_LESS: Final = re.compile(r"\s*2\s*-\s*([A-Za-z]\w*)\s*")


class ParameterKey(NamedTuple):
    """A formula's parameter as passed to the core; ``less`` is an index into the parameters."""

    name: str
    power: float
    less: int | None
    unit: str
    range: tuple[float, float]
    typical: tuple[float, float]
    meaning: str
    role: str | None


class FormulaKey(NamedTuple):
    """A formula as passed to the core."""

    name: str
    term: str
    revealed_by: str
    parameters: tuple[ParameterKey, ...]


@dataclasses.dataclass(frozen=True)
class Formula:
    """An effect that you write as a formula.

    Models, trajectories, maps, fits and a diagnosis take it like an effect of the library. Called
    with values for its parameters it returns an :class:`~pendmap.Effect`.

    Parameters
    ----------
    name : str
        A name that the library does not have: a letter, then letters, digits and ``_``.
    term : str
        The torque per moment of inertia on the right of ``th'' = ...``: numbers, ``pi``, ``+ - * /
        ^`` and brackets; ``theta`` (rad, not wrapped), ``v`` (velocity), ``phase`` (of the harmonic
        drive, rad), ``t`` (time in the laboratory, fixed in maps), ``w0``, ``a`` (the pivot's
        upward acceleration over gravity) and the parameters; ``sqrt exp log sin cos tanh abs sign
        min max`` and ``wrap``, which subtracts whole turns from an angle. It is valid in SI and
        without dimensions, where ``w0`` is 1.
    parameters : mapping
        For each parameter, one to three, its power of ``w0`` or a mapping of

        - ``power``: its value in SI is the one without dimensions times this power of ``w0``; or
          ``"2 - n"``, with another parameter ``n``;
        - ``role``: ``size``, ``width``, ``place``, ``power``, ``order`` (times in a turn, a whole
          number), ``time constant``, ``phase``, ``frequency``, ``instant`` or ``mode`` (frequency
          or damping ratio of a mode of the rig); by default by the term and the power of ``w0``;
        - ``typical``: the smallest and the largest value of interest, without dimensions, that a
          search covers; by default 1e-4 and 0.3;
        - ``range``: the least and the greatest value allowed, without dimensions; by default any;
        - ``unit``, in SI, and ``meaning``.

        The first one is the size; a diagnosis needs a term proportional to it. A further one is a
        phase if the term is 2 pi periodic in it; all others are shapes, of which a diagnosis scans
        the first.
    revealed_by : str
        Data that show it, for the advice of a diagnosis.

    Raises
    ------
    InputError
        If something is missing, the term cannot be read, its units do not balance, it is not a
        number somewhere, or it jumps elsewhere than at zero velocity; on one line.

    Notes
    -----
    ``sign(v)`` times a factor that does not vanish at rest is dry friction and sticks exactly.
    Steps end where the argument of one ``abs``, ``min`` or ``max`` passes zero; with several such
    arguments the order is low there, and more steps are taken.

    Examples
    --------
    >>> drag = Formula("root_drag", "-k*sqrt(abs(v))*sign(v)", {"k": 1.5})
    >>> drag(k=0.02).parameters
    {'k': 0.02}
    """

    name: str
    term: str
    parameters: Mapping[str, Any]
    revealed_by: str = ""
    key: FormulaKey = dataclasses.field(init=False, repr=False, compare=True)
    definition: EffectDefinition = dataclasses.field(init=False, repr=False, compare=False)
    proportional: bool = dataclasses.field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        from pendmap import _core  # noqa: PLC0415 (only models with formulas need it)

        for what in ("name", "term", "revealed_by"):
            if not isinstance(getattr(self, what), str):
                shown = short_repr(getattr(self, what))
                raise InputError(f"formula: {what} must be a text, got {shown}")
        if not isinstance(self.parameters, Mapping) or not self.parameters:
            shown = short_repr(self.parameters)
            raise InputError(
                f"formula '{self.name}': parameters must be like {{'k': 1.5}}, with their powers "
                f"of w0, got {shown}"
            )
        names = list(self.parameters)
        with named(f"formula '{self.name}'"):
            parts, tables = zip(
                *(_parameter(n, self.parameters[n], names) for n in names), strict=True
            )
        if self.name in (*BARE_KEYS, *SI_KEYS):
            raise InputError(
                f"formula '{self.name}': the name must be another, a pendulum has a parameter of "
                "that name"
            )
        key = FormulaKey(self.name, self.term, self.revealed_by, parts)
        with core_errors():
            entry, proportional = _core.formula(key)
        described = dict(zip(names, tables, strict=True))
        definition = EffectDefinition.of(entry)
        fields = {"key": key, "definition": definition, "proportional": proportional}
        for what, value in (fields | {"parameters": described}).items():
            object.__setattr__(self, what, value)

    def __hash__(self) -> int:
        return hash(self.key)

    def __call__(self, **parameters: float) -> Effect:
        """Return the effect with values for its parameters."""
        return Effect(self.name, parameters, formula=self)

    @property
    def table(self) -> dict[str, Any]:
        """The table ``[[formula]]`` of a file."""
        table = {"name": self.name, "term": self.term, "parameters": dict(self.parameters)}
        return table | ({"revealed_by": self.revealed_by} if self.revealed_by else {})


def each_table(
    name: str, tables: object, keys: tuple[str, ...], examples: Mapping[str, str]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Check the keys of the tables ``[[name]]`` of a file; yield their places and contents."""
    if not isinstance(tables, list):
        raise InputError(f"{name} must be [[{name}]], one table each, got {short_repr(tables)}")
    for count, table in enumerate(tables, 1):
        where = f"[[{name}]] {count}"
        if not isinstance(table, dict):
            raise InputError(f"{where}: must be a table, got {short_repr(table)}")
        check_keys(f"{where}: ", table, keys)
        for key, example in examples.items():
            if key not in table:
                raise InputError(f"{where}: {key} must be given, like {key} = {example}")
        yield where, table


def formulas_of(tables: object) -> dict[str, Formula]:
    """Return the formulas of a file's tables ``[[formula]]`` by name, each name once."""
    formulas: dict[str, Formula] = {}
    for where, table in each_table("formula", tables, FORMULA, _EXAMPLES):
        formula = Formula(**table)
        if formula.name in formulas:
            raise InputError(f"{where}: each name must occur once, {formula.name} occurs twice")
        formulas[formula.name] = formula
    return formulas


def load_formulas(path: str | os.PathLike[str]) -> list[Formula]:
    r"""Read the tables ``[[formula]]`` of a file.

    Parameters
    ----------
    path : str or path
        A TOML file: formulas alone, or a model with formulas.

    Raises
    ------
    InputError
        If it is not TOML, has no formulas, or one that :class:`Formula` refuses.
    OSError
        If it cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> import pendmap
    >>> text = '[[formula]]\nname = "lean"\nterm = "-k*sqrt(abs(v))*sign(v)"\n'
    >>> _ = Path("own.toml").write_text(text + "parameters = { k = 1.5 }")
    >>> [formula.name for formula in pendmap.load_formulas("own.toml")]
    ['lean']
    """
    content = read_toml(path)
    unknown = [key for key in content if key not in ("formula", "format_version")]
    with named(os.fspath(path)):
        if unknown and "pendulum" not in content:
            raise InputError(f"{unknown[0]} is not known: all must be tables [[formula]]")
        if not content.get("formula"):
            raise InputError("has no table [[formula]]")
        return list(formulas_of(content["formula"]).values())


def _parameter(
    name: object, given: object, names: list[Any]
) -> tuple[ParameterKey, dict[str, Any]]:
    """Return a parameter as passed to the core, and as a table without defaults."""
    if not isinstance(name, str):
        raise InputError(f"parameter must be a name, got {short_repr(name)}")
    entry = given if isinstance(given, Mapping) else {"power": given}
    check_keys(f"parameter '{name}': ", entry, PARAMETER)
    if "power" not in entry:
        raise InputError(f"parameter '{name}': power is missing: the power of w0 in its unit")
    power, less = _power(name, entry["power"], names)
    unit = f"s^{-power:g}" if power != 0 else "1"
    defaults = {
        "typical": _TYPICAL,
        "range": (-math.inf, math.inf),
        "unit": unit if less is None else f"s^({names[less]}-2)",
        "meaning": "",
        "role": None,
    }
    values: dict[str, Any] = dict(defaults)
    for what in ("unit", "meaning", "typical", "range", "role"):
        if what in entry:
            values[what] = _checked(
                f"parameter '{name}': {what}", what, entry[what], first=name == names[0]
            )
    changed = {key: value for key, value in values.items() if value != defaults[key]}
    table = {key: list(v) if isinstance(v, tuple) else v for key, v in changed.items()}
    key = ParameterKey(name=name, power=power, less=less, **values)
    return key, {"power": power if less is None else f"2 - {names[less]}"} | table


def _power(name: str, value: object, names: list[Any]) -> tuple[float, int | None]:
    if not isinstance(value, str):
        return check_number(f"parameter '{name}': power", value), None
    match = _LESS.fullmatch(value)
    if match is None or match[1] not in names or match[1] == name:
        others = " or ".join(f'"2 - {n}"' for n in names if n != name)
        raise InputError(
            f"parameter '{name}': power must be a number"
            + (f", or {others}" if others else "")
            + f", got {short_repr(value)}"
        )
    return 2.0, names.index(match[1])


def _checked(where: str, what: str, value: object, *, first: bool) -> object:
    """Return a checked property of a parameter; only the first parameter has the role ``size``."""
    if what in {"typical", "range"}:
        if not isinstance(value, list | tuple) or len(value) != 2:  # noqa: PLR2004
            raise InputError(f"{where} must be [low, high], got {short_repr(value)}")
        unbounded = what == "range"
        return tuple(
            end
            if unbounded and isinstance(end, float) and math.isinf(end)
            else check_number(where, end)
            for end in value
        )
    if what == "role":
        from pendmap import _core  # noqa: PLC0415 (only models with formulas need it)

        known = [role for role in _core.roles() if (role == "size") == first]
        if value not in known:
            wanted = ", ".join(known)
            raise InputError(f"{where} must be one of {wanted}, got {short_repr(value)}")
    elif not isinstance(value, str):
        raise InputError(f"{where} must be a text, got {short_repr(value)}")
    return value
