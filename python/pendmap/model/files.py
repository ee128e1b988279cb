"""Model files: TOML in and out, without dimensions or in SI."""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from pendmap.errors import InputError, check_number, check_type, check_whole, short_repr
from pendmap.files import read_toml, toml_text, whole_file
from pendmap.model import quantities
from pendmap.model.covariance import without
from pendmap.model.effects import Effect
from pendmap.model.formula import Formula, formulas_of
from pendmap.model.pendulum import Pendulum
from pendmap.model.rig import COUNTERPARTS, Rig
from pendmap.units import Units

_FORMAT: Final = 1
"""Version of the layout of model files, in their key ``format_version``."""
_NOTES: Final = ("covariance", "provenance")
_EFFECT: Final = ("name", "parameters", "ci95", "probability", "approximate")

_SI: Final = (*(n for ways in quantities.GROUPS.values() for n in ways), *quantities.OPTIONAL)
_BARE: Final = (*COUNTERPARTS, "zeta")
_ONLY_SI: Final = tuple(name for name in _SI if name not in _BARE)
_ONLY_BARE: Final = tuple(name for name in _BARE if name not in _SI)


def load_model(
    path: str | os.PathLike[str], typed: Mapping[str, float] | None = None
) -> Pendulum | Rig:
    """Read a model file.

    The table ``[pendulum]`` has the parameters of a :class:`Pendulum`, or those of a :class:`Rig`
    in SI with the other ways to write them that :meth:`Rig.of` takes; without dimensions ``zeta``
    may stand for ``gamma`` = 2 zeta. A key that is left out is 0. Each ``[[effect]]`` has a
    ``name`` and ``parameters`` and may have ``ci95``, ``probability`` and ``approximate``; each
    ``[[formula]]`` is a :class:`Formula`, which effects may name; ``[covariance]`` and
    ``[provenance]`` are kept as they are in the model's ``notes``; what is typed is known exactly,
    and no longer part of the covariance.

    Parameters
    ----------
    path : str or path
        The file.
    typed : mapping of str to float, optional
        Parameters that count instead of the file's: those of a pendulum without dimensions, also
        where the file is in SI, and there ``stroke_mm`` and ``frequency_hz``.

    Returns
    -------
    Pendulum or Rig
        Whichever the file's keys say.

    Raises
    ------
    InputError
        If the file is not TOML, has keys that are not known, keys of both kinds, values that are
        no numbers or outside their ranges, or numbers that contradict; on one line that names the
        file.
    OSError
        If it cannot be read.
    """
    content = read_toml(path)
    typed = dict(typed or {})
    try:
        _check_top(content)
        table = _pendulum_table(content)
        effects = _effects(content.get("effect", []), formulas_of(content.get("formula", [])))
        notes: dict[str, Any] = {name: content[name] for name in _NOTES if name in content}
        if _is_si(table):
            exact = [_own_name(name) for name in typed]
            numbers = _typed_over(table, typed)
            return Rig.of(**numbers, effects=effects, notes=without(notes, exact))
        return _pendulum(table, typed, effects, without(notes, typed))
    except InputError as error:
        raise InputError(f"{os.fspath(path)}: {error}") from None


def save_model(model: Pendulum | Rig, path: str | os.PathLike[str]) -> Path:
    """Write a model file; it is complete or absent, and reads back as the same model.

    Parameters
    ----------
    model : Pendulum or Rig
        Its ``notes`` are written as the tables ``[covariance]`` and ``[provenance]``.
    path : str or path
        A .toml file.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If it is no model, the suffix is not .toml, or the notes are no tables for TOML.
    OSError
        If the file cannot be written.
    """
    if not isinstance(model, Rig):
        check_type("model", model, Pendulum, "Pendulum(p=0.6)")
    numbers = {name: getattr(model, name) for name in model.numbers()}
    if isinstance(model, Rig) and model.Omega == 0:
        del numbers["Omega"]  # nothing is driven
    content: dict[str, Any] = {"format_version": _FORMAT, "pendulum": numbers}
    formulas = [effect.formula.table for effect in model.effects if effect.formula is not None]
    if formulas:
        content["formula"] = formulas
    if model.effects:
        content["effect"] = [_table(effect) for effect in model.effects]
    try:
        _check_notes(model.notes)
        text = toml_text(content | dict(model.notes))
    except (TypeError, ValueError) as error:
        raise InputError(f"{os.fspath(path)}: notes: {error}") from None
    with whole_file(path, (".toml",)) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    return Path(path)


def _pendulum_table(content: dict[str, Any]) -> dict[str, Any]:
    table = content.get("pendulum")
    if not isinstance(table, dict):
        raise InputError("has no table [pendulum]")
    return table


def _check_top(content: dict[str, Any]) -> None:
    known = ("pendulum", "formula", "effect", *_NOTES, "format_version")
    unknown = [key for key in content if key not in known]
    if unknown:
        shown = f"[{unknown[0]}]" if isinstance(content[unknown[0]], dict) else unknown[0]
        tables = "[pendulum], [[formula]], [[effect]], [covariance], [provenance]"
        raise InputError(f"{shown} is not known: it must be one of {tables} and format_version")
    version = content.get("format_version", _FORMAT)
    check_whole("format_version", version, 1, _FORMAT)
    _check_notes({name: content[name] for name in _NOTES if name in content})


def _check_notes(notes: object) -> None:
    if not isinstance(notes, Mapping):
        raise InputError(f"notes must be a mapping, got {short_repr(notes)}")
    for name, table in notes.items():
        if name not in _NOTES:
            raise InputError(
                f"{short_repr(name)} is not known: it must be one of {', '.join(_NOTES)}"
            )
        if not isinstance(table, Mapping):
            raise InputError(f"{name} must be a table [{name}], got {short_repr(table)}")


def _is_si(table: dict[str, Any]) -> bool:
    """Whether a table is in SI; all its keys are checked."""
    for key in table:
        if key not in _SI and key not in _BARE:
            raise InputError(f"{_shown(key)} is not known{_instead(key)}")
    si = [key for key in table if key in _ONLY_SI]
    bare = [key for key in table if key in _ONLY_BARE]
    if si and bare:
        raise InputError(
            f"{bare[0]} has no dimensions and {si[0]} is in SI: both must be of one kind; "
            f"{bare[0]} is {COUNTERPARTS[bare[0]][0]} in SI"
        )
    return bool(si)


def _shown(key: str) -> str:
    return key if key.isidentifier() else short_repr(key)


def _instead(key: str) -> str:
    """Return the end of the sentence that a key is not known: what may stand in its place."""
    stem = key.rsplit("_", 1)[0]
    for known, unit in quantities.SI_UNITS.items():
        if known.rsplit("_", 1)[0] in (key, stem) or known == stem:
            return f": it must be {known}, in {unit}"
    near = difflib.get_close_matches(key, (*_BARE, *_SI), n=1, cutoff=0.7)
    nearest = f", perhaps {near[0]} is meant" if near else ""
    without = ", ".join(_BARE)
    return f"{nearest}: it must be one of {without}, or in SI {', '.join(_SI)}"


def _own_name(name: str) -> str:
    """Return what a :class:`Rig` calls a quantity that is typed."""
    if name in COUNTERPARTS:
        return COUNTERPARTS[name][0]
    return next((own for own, ways in quantities.GROUPS.items() if name in ways), name)


def _typed_over(table: dict[str, Any], typed: Mapping[str, float]) -> dict[str, Any]:
    """Return the quantities of a table in SI with those that were typed in their places."""
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


def _pendulum(
    table: dict[str, Any],
    typed: Mapping[str, float],
    effects: tuple[Effect, ...],
    notes: dict[str, Any],
) -> Pendulum:
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
    driven = numbers.get("p", 0) != 0 or any(effect.drives for effect in effects)
    if driven and "omega" not in numbers:
        raise InputError("p without omega: a drive needs a frequency above 0")
    zeros = {name: float(name == "omega") for name in COUNTERPARTS}
    return Pendulum(**(zeros | numbers), effects=effects, notes=notes)


def _effects(tables: object, formulas: Mapping[str, Formula]) -> tuple[Effect, ...]:
    if not isinstance(tables, list):
        raise InputError(f"effect must be [[effect]], one table each, got {short_repr(tables)}")
    effects = []
    for count, table in enumerate(tables, 1):
        try:
            effects.append(_effect(table, formulas))
        except InputError as error:
            raise InputError(f"[[effect]] {count}: {error}") from None
    return tuple(effects)


def _effect(table: object, formulas: Mapping[str, Formula]) -> Effect:
    if not isinstance(table, dict):
        raise InputError(f"must be a table, got {short_repr(table)}")
    unknown = [key for key in table if key not in _EFFECT]
    if unknown:
        raise InputError(
            f"{_shown(unknown[0])} is not known: it must be one of {', '.join(_EFFECT)}"
        )
    for key, example in (("name", '"quadratic_drag"'), ("parameters", "{ q = 0.01 }")):
        if key not in table:
            raise InputError(f"{key} must be given, like {key} = {example}")
    name = table["name"]
    formula = formulas.get(name) if isinstance(name, str) else None
    try:
        return Effect(**table, formula=formula)
    except InputError as error:
        own = ", ".join(formulas)
        if formula is None and formulas and str(error).startswith("name must be"):
            raise InputError(f"{error}, and this file's [[formula]] are {own}") from None
        raise


def _table(effect: Effect) -> dict[str, Any]:
    """Return an effect as a table; what it does not say is left out."""
    said = {key: getattr(effect, key) for key in _EFFECT}
    said["ci95"] = {name: list(bounds) for name, bounds in effect.ci95.items()} or None
    return {key: value for key, value in said.items() if value is not None}
