"""Tables of model files: their keys, and their conversion to the arguments of a model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from pendmap.errors import InputError, check_keys, check_number, check_whole, short_repr
from pendmap.files import toml_text
from pendmap.model import quantities
from pendmap.model.covariance import without
from pendmap.model.effects import Effect, is_driven
from pendmap.model.formula import each_table, formulas_of
from pendmap.model.quantities import BARE_KEYS, COUNTERPARTS, SI_KEYS
from pendmap.units import Units

FORMAT: Final = 1  # Version of the layout of model files, in their key ``format_version``
TOP: Final = ("pendulum", "formula", "effect", "covariance", "provenance", "format_version")
NOTES: Final = ("covariance", "provenance")
EFFECT: Final = ("name", "parameters", "ci95", "probability", "approximate")
_EXAMPLES: Final = {"name": '"quadratic_drag"', "parameters": "{ q = 0.01 }"}
"""Keys that an effect needs, with examples for messages."""

_ONLY_SI: Final = tuple(name for name in SI_KEYS if name not in BARE_KEYS)
_ONLY_BARE: Final = tuple(name for name in BARE_KEYS if name not in SI_KEYS)


def model_arguments(
    content: dict[str, Any], typed: Mapping[str, float]
) -> tuple[bool, dict[str, Any]]:
    """Return whether a parsed file is in SI, and the arguments of its model, ``typed`` over it."""
    _check_top(content)
    table = content.get("pendulum")
    if not isinstance(table, dict):
        raise InputError("has no table [pendulum]")
    effects = effects_in(content)
    in_si = _is_si(table)
    numbers = _typed_over(table, typed) if in_si else _bare_numbers(table, typed, effects)
    names = {n: si for si, ways in quantities.GROUPS.items() for n in ways}
    names |= {bare: si for bare, (si, _) in COUNTERPARTS.items()}
    exact = [names.get(name, name) if in_si else name for name in typed]
    notes = without({name: content[name] for name in NOTES if name in content}, exact)
    return in_si, {**numbers, "effects": effects, "notes": notes}


def _check_top(content: dict[str, Any]) -> None:
    unknown = [key for key in content if key not in TOP]
    if unknown:
        shown = f"[{unknown[0]}]" if isinstance(content[unknown[0]], dict) else unknown[0]
        tables = "[pendulum], [[formula]], [[effect]], [covariance], [provenance]"
        raise InputError(f"{shown} is not known: it must be one of {tables} and format_version")
    version = content.get("format_version", FORMAT)
    check_whole("format_version", version, 1, FORMAT)
    check_notes({name: content[name] for name in NOTES if name in content})


def check_notes(notes: object) -> None:
    """Raise InputError for notes that a model file cannot hold."""
    if not isinstance(notes, Mapping):
        raise InputError(f"notes must be a mapping, got {short_repr(notes)}")
    check_keys("", notes, NOTES)
    for name, table in notes.items():
        if not isinstance(table, Mapping):
            raise InputError(f"{name} must be a table [{name}], got {short_repr(table)}")


def _is_si(table: dict[str, Any]) -> bool:
    """Return whether a table is in SI; check all its keys."""
    among = f"{', '.join(BARE_KEYS)}, or in SI {', '.join(SI_KEYS)}"
    check_keys("", table, (*SI_KEYS, *BARE_KEYS), among)
    si = [key for key in table if key in _ONLY_SI]
    bare = [key for key in table if key in _ONLY_BARE]
    if si and bare:
        raise InputError(
            f"{bare[0]} has no dimensions and {si[0]} is in SI: both must be of one kind; "
            f"{bare[0]} is {COUNTERPARTS[bare[0]][0]} in SI"
        )
    return bool(si)


def _typed_over(table: dict[str, Any], typed: Mapping[str, float]) -> dict[str, Any]:
    """Return the quantities of a table in SI, replaced by typed ones."""
    units = Units(quantities.natural_frequency(table), si=True)
    numbers = dict(table)
    for name, value in typed.items():
        bare = COUNTERPARTS.get(name)
        si, number = (bare[0], units.given(value, bare[1])) if bare else (name, value)
        group = next((ways for ways in quantities.GROUPS.values() if si in ways), (si,))
        for other in group:
            if other not in typed:
                numbers.pop(other, None)
        numbers[si] = number
    return numbers


def _bare_numbers(
    table: dict[str, Any], typed: Mapping[str, float], effects: tuple[Effect, ...]
) -> dict[str, float]:
    for name in typed:
        if name not in COUNTERPARTS:
            raise InputError(
                f"has no dimensions: {name} must be given with a model in SI; here it is p or omega"
            )
    numbers = {name: check_number(name, value) for name, value in table.items()}
    zeta = numbers.pop("zeta", None)
    if zeta is not None and "gamma" not in typed:
        gamma = 2 * quantities.check("zeta", zeta)
        given = numbers.setdefault("gamma", gamma)
        quantities.one("gamma", {"gamma": given, f"2 zeta of zeta = {zeta:g}": gamma})
    numbers |= typed
    if is_driven(numbers.get("p", 0), effects) and "omega" not in numbers:
        raise InputError("p without omega: a drive needs a frequency above 0")
    zeros = {name: float(name == "omega") for name in COUNTERPARTS}
    return zeros | numbers


def effects_in(content: Mapping[str, Any]) -> tuple[Effect, ...]:
    """Return the effects of a model file, with its formulas."""
    effects, formulas = [], formulas_of(content.get("formula", []))
    for where, table in each_table("effect", content.get("effect", []), EFFECT, _EXAMPLES):
        name = table["name"]
        formula = formulas.get(name) if isinstance(name, str) else None
        try:
            effects.append(Effect(**table, formula=formula))
        except InputError as error:
            unknown = formula is None and formulas and str(error).startswith("name must be")
            others = f", and this file's [[formula]] are {', '.join(formulas)}" if unknown else ""
            raise InputError(f"{where}: {error}{others}") from None
    return tuple(effects)


def model_text(model: Any) -> str:  # noqa: ANN401 (a Pendulum or a Rig)
    """Return the text of a model file; TypeError or ValueError for notes it cannot hold."""
    numbers = {name: getattr(model, name) for name in model.numbers()}
    if numbers.get("Omega") == 0:
        del numbers["Omega"]  # nothing is driven
    if getattr(model, "given_stroke", None) is not None:
        numbers["Y"] = model.given_stroke
        del numbers["p"]
    content: dict[str, Any] = {"format_version": FORMAT, "pendulum": numbers}
    formulas = [effect.formula.table for effect in model.effects if effect.formula is not None]
    if formulas:
        content["formula"] = formulas
    if model.effects:
        content["effect"] = [_table(effect) for effect in model.effects]
    check_notes(model.notes)
    return toml_text(content | dict(model.notes))


def _table(effect: Effect) -> dict[str, Any]:
    """Return an effect as a table without empty keys."""
    entries = {key: getattr(effect, key) for key in EFFECT}
    entries["ci95"] = {name: list(bounds) for name, bounds in effect.ci95.items()} or None
    return {key: value for key, value in entries.items() if value is not None}
