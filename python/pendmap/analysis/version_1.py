"""Conversion of results whose files have the format 1 to that of today."""

from __future__ import annotations

import importlib
import json
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.cell_search import UNDECIDED
from pendmap.analysis.parameter_map import having
from pendmap.files.dataset import FORMAT_VERSION
from pendmap.model import Effect, Formula, Pendulum, Rig
from pendmap.model.labels import LABELS
from pendmap.model.pendulum import model_text
from pendmap.model.quantities import COUNTERPARTS
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from pendmap.analysis.result import Schema

_UNITS: Final = ("1 / w0", "1 per tau", "nat", "turns", "forcing periods")
"""Units that UDUNITS-2 does not have, of pure numbers."""
_RENAMED: Final = {
    "inverted": "inverted_rest",
    "doubt_start": "doubt_start_mean",
    "doubt_parameters": "doubt_parameters_mean",
}
"""Attributes with another name today."""
_OF_DRAWS: Final = (
    "sure_cells",
    "doubt_start_mean",
    "doubt_parameters_mean",
    "drawn_others",
    "mean_periods_low",
    "mean_periods_high",
    "transient_share",
    "persistent_share",
)
"""Attributes of draws that are variables today."""
_SETS: Final = {"outcome_kinds": ("outcome", "outcome_kind"), "regime_kinds": ("set", "kind")}
"""Variables with sets of kinds in JSON: their dimension, and that of the kinds."""
_SETS_BY: Final = {"stroke_mm": "p", "frequency_hz": "Omega"}
"""Quantities that vary, and the parameter of a rig that each sets."""


def upgraded(dataset: xr.Dataset) -> xr.Dataset:
    """Return a result of the format 1 as one of today's; missing long names stay missing.

    There numbers that were computed and parameters were attributes, effects and sets of kinds JSON.
    """
    old = {_RENAMED.get(name, name): value for name, value in dataset.attrs.items()}
    schema: Schema = importlib.import_module(f"pendmap.analysis.{old['kind']}").SCHEMA
    for each in dataset.variables.values():
        if each.attrs.get("units") in _UNITS:
            each.attrs["units"] = "1"
    for name, (dim, kind) in _SETS.items():
        if name in dataset:
            sets = [json.loads(text) for text in dataset[name].values.tolist()]
            if kind not in dataset:
                kinds = sorted(set().union(*sets) - {UNDECIDED})
                dataset = dataset.assign_coords({kind: np.array(kinds, dtype=str)})
            has = having(dim, sets, dataset[kind].values.tolist())
            dataset = dataset.drop_vars(name).assign({name.replace("kinds", "has"): has})
    parameters = {name: old.pop(name) for name in LABELS if name in old}
    units = Units.of(old | parameters)
    make = Rig if units.si else Pendulum
    numbers: dict[str, Any] = {name: float(parameters[name]) for name in make.numbers()}
    old["model"] = model_text(make(**numbers, effects=_effects(old)))
    old["format_version"] = FORMAT_VERSION
    dataset.attrs = {}
    for field in schema.fields:
        value = old.pop(field.name, None)
        if value is not None:
            field.put(dataset, value, units)
    dataset = dataset.assign({name: ((), old.pop(name)) for name in _OF_DRAWS if name in old})
    dataset.attrs = old | dataset.attrs
    gone = _replaced(dataset.attrs)
    schema.describe(dataset, {n: x for n, x in parameters.items() if n not in gone})
    return dataset


def _replaced(attributes: Mapping[str, Any]) -> set[str]:
    """Return the model's own parameters that others replace, in both units."""
    varied = [attributes.get(which, "") for which in ("columns", "rows", "varied")]
    own = {_SETS_BY.get(name, name) for name in varied}
    pairs = ({bare, si} for bare, (si, _) in COUNTERPARTS.items())
    return own.union(*(pair for pair in pairs if pair & own))


def _effects(attributes: dict[str, Any]) -> tuple[Effect, ...]:
    """Return the effects of a model from their list in JSON, which is removed."""
    return tuple(
        Effect(
            one["name"],
            one["parameters"],
            formula=Formula(**one["formula"]) if "formula" in one else None,
        )
        for one in json.loads(attributes.pop("effects", "[]"))
    )
