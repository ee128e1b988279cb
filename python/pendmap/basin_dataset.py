"""The labelled dataset of a basin map: cells, table of attractors, attributes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap import _core, orbit_table
from pendmap.model import without_dimensions
from pendmap.model.units import RATE, Units
from pendmap.store import FORMAT_VERSION
from pendmap.summary import summarise
from pendmap.texture import passes_log2
from pendmap.uncertainty import fitted_map
from pendmap.words import counted

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.model import Pendulum, Rig

__all__ = ["RELIABLE", "cells", "complete", "table", "uncertain_starts"]

RELIABLE: Final = 0.05
"""Labels of which a larger share changes under half the step or mirroring are not reliable."""

_LAYERS: Final = {
    "basins": "labels",
    "only_chaos": "finite_time",
    "conservative": "finite_time",
}


def cells(
    raw: dict[str, Any], dims: tuple[str, ...], shape: tuple[int, ...], units: Units
) -> dict[str, Any]:
    """Return the variables with one value a start, over ``dims`` of ``shape``."""
    finite_time = _LAYERS[raw["plane"]] == "finite_time"
    when = "until settled"
    if finite_time:
        when = f"after {counted(raw['layer_periods'], 'period')}"
    elif not (raw["settle"] >= 0).any():
        when = f"after {counted(raw['bound'], 'period')}"
    label = {
        "long_name": "attractor",
        "comment": "number of the attractor; 0 undecided within the bound, -1 failed or diverged",
    }
    cells: dict[str, Any] = {
        "label": (dims, raw["label"].reshape(shape), label),
        "settle_periods": (
            dims,
            raw["settle"].reshape(shape),
            {
                "long_name": "periods until an attractor's trap holds the trajectory",
                "units": "1",
                "comment": "-1 where no attractor captured it",
            },
        ),
        "net_turns": (
            dims,
            raw["turns"].reshape(shape),
            {
                "long_name": f"net turns {when}",
                "units": "1",
                "comment": "the angle's displacement over 2 pi, rounded",
            },
        ),
    }
    exponent = raw["finite_time_exponent"]
    if exponent is not None:
        attributes = {"long_name": f"finite-time Lyapunov exponent {when}", "units": units.of_rate}
        values = units.given(exponent, RATE).reshape(shape)
        cells["finite_time_exponent"] = (dims, values, attributes)
    return cells


def uncertain_starts(raw: dict[str, Any]) -> dict[str, Any]:
    """Counts of starts whose label changes nearby, over ``distance``; none without a boundary."""
    if not raw["uncertainty_eps"].size:
        return {}
    what = "distance in sides of the window"
    return {
        "uncertainty_eps": ("distance", raw["uncertainty_eps"], {"units": "1", "long_name": what}),
        "uncertain": (
            "distance",
            raw["uncertain"].astype(np.int64),
            {"long_name": "starts with another label at this distance on one side or the other"},
        ),
        "uncertainty_tried": (
            "distance",
            raw["uncertainty_tried"].astype(np.int64),
            {
                "long_name": "starts with known ends, drawn anew for each distance; where drawn by "
                "strata, as many drawn evenly as tell the share as precisely"
            },
        ),
    }


def complete(
    dataset: xr.Dataset,
    raw: dict[str, Any],
    model: Pendulum | Rig,
    choices: _core._Choices,
    seconds: float,
) -> xr.Dataset:
    """Add the table of attractors, all attributes and the summary to the cells."""
    count = dataset["label"].size
    dataset = dataset.assign(table(raw["attractors"], count, model.units)).assign_coords(
        attractor=("attractor", np.array([a["name"] for a in raw["attractors"]], dtype=str)),
    )
    settle = dataset["settle_periods"].values
    settled = settle[settle >= 0]
    mirror = raw["unreliable_mirror"]
    dataset.attrs = {
        "kind": "basins",
        "title": model.title,
        **model.attributes,
        "section": model.units.section,
        "tol": choices["tol"],
        "reached_error": raw["reached_error"],
        "steps_per_period": raw["steps_per_period"],
        "max_periods": raw["bound"],
        "chaos_bound": raw["chaos_bound"],
        "searched_starts": raw["searched_starts"],
        "plane": raw["plane"],
        "layers": _LAYERS[raw["plane"]],
        "layer_periods": raw["layer_periods"],
        "cells": count,
        "undecided": raw["undecided"],
        "failed": raw["failed"],
        "mean_periods": raw["mean_periods"],
        "mean_settle": float(settled.mean()) if settled.size else -1.0,
        "longest_settle": int(settled.max()) if settled.size else -1,
        "basin_entropy": raw["basin_entropy"],
        **_boundary(dataset, raw),
        "neighbours_agree": raw["neighbours_agree"],
        "neighbours_chance": raw["chance"],
        "unreliable": raw["unreliable"],
        "unreliable_half_step": raw["unreliable_half_step"],
        **({} if mirror is None else {"unreliable_mirror": mirror}),
        "labels_sampled": raw["labels_sampled"],
        "labels_reliable": int(raw["unreliable"] <= RELIABLE),
        "seconds": seconds,
        "simd": raw["simd"],
        "threads": choices["threads"] or _core.default_threads(),
        "seed": choices["seed"],
        "pendmap_version": _core.__version__,
        "format_version": FORMAT_VERSION,
    }
    chosen = choices["max_periods"] is None
    pendulum, _ = without_dimensions(model)
    dataset.attrs["summary"] = summarise(dataset, pendulum, bound_was_chosen=chosen)
    return dataset


def _boundary(dataset: xr.Dataset, raw: dict[str, Any]) -> dict[str, float]:
    """What tells how fractal the boundary is, as far as there is one."""
    found: dict[str, float] = {}
    if raw["boundary_boxes"]:
        found["boundary_basin_entropy"] = raw["boundary_basin_entropy"]
        found["boundary_boxes"] = raw["boundary_boxes"]
        if math.isfinite(raw["boundary_stderr"]):
            found["boundary_basin_entropy_stderr"] = raw["boundary_stderr"]
        found["log2_criterion"] = int(
            passes_log2(raw["boundary_basin_entropy"], raw["boundary_stderr"])
        )
    if "uncertainty_eps" in dataset:
        law = fitted_map(dataset)
        if law is not None:
            found["uncertainty_exponent"] = law.value
            found["uncertainty_exponent_stderr"] = law.stderr
            found["uncertainty_exponent_low"], found["uncertainty_exponent_high"] = law.ci95
            found["uncertainty_eps_low"] = float(law.eps[0])
            found["uncertainty_eps_high"] = float(law.eps[law.scales - 1])
    return found


def table(attractors: list[dict[str, Any]], count: int, units: Units) -> dict[str, Any]:
    """The attractors with their shares of ``count`` starts, and their points, as variables."""
    one = "attractor"
    fraction = np.array([a["fraction"] for a in attractors], dtype=float)
    return {
        **orbit_table.table(attractors, units, one),
        "fraction": (one, fraction),
        "stderr": (one, np.sqrt(fraction * (1 - fraction) / max(count, 1))),
    }
