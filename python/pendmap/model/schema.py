"""The JSON Schema of model files, from the tables that check them.

Editors use it to complete keys: ``python -m pendmap.model.schema > model.schema.json`` writes it,
and a model file names it in its first line, ``#:schema ./model.schema.json``.
"""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any

from pendmap import _core
from pendmap.model.effects import library
from pendmap.model.formula import FORMULA, PARAMETER
from pendmap.model.labels import LABELS
from pendmap.model.tables import BARE_KEYS, EFFECT, FORMAT, SI_KEYS, TOP

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pendmap.model.effects import EffectDefinition
    from pendmap.model.labels import Label

_NUMBER = {"type": "number"}
_TEXT = {"type": "string"}
_RANGE = {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2}


def schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 7) of model files.

    Examples
    --------
    >>> schema()["required"]
    ['pendulum']
    """
    rig = {name: _labelled(LABELS[name]) for name in SI_KEYS}
    bare = {name: _labelled(LABELS[name]._replace(unit="")) for name in BARE_KEYS}
    name = _TEXT | {"not": {"enum": [*library()]}}
    by_formula = _of_effect("An effect by a formula of this file", name, _values(_NUMBER))
    given = [{"required": [name]} for name in ("w0", "length_m")]
    parts: dict[str, Any] = {
        "pendulum": {
            "anyOf": [_table("In SI", rig) | {"anyOf": given}, _table("Without dimensions", bare)]
        },
        "formula": {"type": "array", "items": _formula()},
        "effect": {
            "type": "array",
            "items": {"anyOf": [*map(_effect, library().values()), by_formula]},
        },
        "covariance": {"type": "object", "description": "Uncertainty of the fitted parameters"},
        "provenance": {"type": "object", "description": "Origin of the numbers"},
        "format_version": {"const": FORMAT},
    }
    top = _table("pendmap model file", {key: parts[key] for key in TOP}, ["pendulum"])
    return {"$schema": "http://json-schema.org/draft-07/schema#"} | top


def _table(title: str, keys: Mapping[str, Any], required: Iterable[str] = ()) -> dict[str, Any]:
    table = {"title": title, "type": "object", "properties": keys, "additionalProperties": False}
    return table | {"required": list(required)}


def _labelled(label: Label) -> dict[str, Any]:
    return _NUMBER | {"description": ", ".join(filter(None, (label.meaning, label.unit)))}


def _effect(effect: EffectDefinition) -> dict[str, Any]:
    """Return the schema of an effect of the library."""
    numbers = {
        parameter.name: _NUMBER | {"description": f"{parameter.meaning}, {parameter.unit} in SI"}
        for parameter in effect.parameters
    }
    parameters = _table(effect.formula, numbers, numbers)
    return _of_effect(effect.name, {"const": effect.name}, parameters)


def _values(of: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "additionalProperties": of}


def _of_effect(title: str, *name_and_parameters: Mapping[str, Any]) -> dict[str, Any]:
    share = _NUMBER | {"minimum": 0, "maximum": 1}
    values = (*name_and_parameters, _values(_RANGE), share, {"type": "boolean"})
    return _table(title, dict(zip(EFFECT, values, strict=True)), EFFECT[:2])


def _formula() -> dict[str, Any]:
    power = {"anyOf": [_NUMBER, _TEXT | {"pattern": r"^\s*2\s*-"}]}
    details = (power, {"enum": _core.roles()}, _RANGE, _RANGE, _TEXT, _TEXT)
    detailed = _table("Parameter", dict(zip(PARAMETER, details, strict=True)), PARAMETER[:1])
    parameters = _values({"anyOf": [power, detailed]}) | {"minProperties": 1, "maxProperties": 3}
    parts = (_TEXT, _TEXT, parameters, _TEXT)
    return _table("Formula", dict(zip(FORMULA, parts, strict=True)), FORMULA[:3])


if __name__ == "__main__":
    sys.stdout.write(json.dumps(schema(), indent=2) + "\n")
