"""Report of a sweep: objects of its JSON, and its summary."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.result import binomial_ci95
from pendmap.analysis.summary import bound_said
from pendmap.analysis.sweeps.table import COUNTS, KINDS, MEASURES
from pendmap.analysis.sweeps.tiles import PLANES
from pendmap.files import facts
from pendmap.formatting import counted, percent, span

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.analysis.sweeps.tiles import Place

_LISTED: Final = 8  # Attractors that the summary names


def varied_names(dataset: xr.Dataset) -> list[str]:
    """Return the names of the parameters of a sweep."""
    return str(dataset.attrs["varied"]).split()


def attractors(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the attractors for JSON, with the ranges in which each exists."""
    dims = varied_names(dataset)
    entries = []
    for k, name in enumerate(dataset["attractor"].values):
        exists = dataset["exists"].values[..., k] > 0
        fraction = dataset["fraction"].values[..., k]
        where = np.unravel_index(int(np.argmax(fraction)), fraction.shape)
        values = [dataset[dim].values[at] for dim, at in zip(dims, np.nonzero(exists), strict=True)]
        entries.append(
            {
                "id": k + 1,
                "name": str(name),
                "twin": int(dataset["twin"].values[k]) or None,
                "models": int(exists.sum()),
                "ranges": {
                    dim: [float(coordinate.min()), float(coordinate.max())]
                    for dim, coordinate in zip(dims, values, strict=True)
                },
                "largest_fraction": float(fraction.max()),
                "largest_at": {
                    dim: float(dataset[dim].values[at]) for dim, at in zip(dims, where, strict=True)
                },
            }
        )
    return entries


def maps(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the maps for JSON, each with its attractors."""
    dims = varied_names(dataset)
    every = [name for name, _, _ in (*MEASURES.values(), *COUNTS.values())]
    entries = []
    for place in np.ndindex(*(dataset.sizes[dim] for dim in dims)):
        one: dict[str, Any] = {
            dim: float(dataset[dim].values[at]) for dim, at in zip(dims, place, strict=True)
        }
        one["plane"] = PLANES[int(dataset["plane"].values[place])]
        for name in every:
            value = dataset[name].values[place].item()
            one[name] = None if isinstance(value, float) and math.isnan(value) else value
        exists = np.flatnonzero(dataset["exists"].values[place])
        one["attractors"] = [_entry(dataset, place, int(k)) for k in exists]
        entries.append(one)
    return entries


def _entry(dataset: xr.Dataset, place: Place, k: int) -> dict[str, Any]:
    """Return an attractor of a map for JSON."""
    at = (*place, k)
    names = ("fraction", "stderr", "exponent", "exponent_stderr", "theta_point", "velocity_point")
    values = {name: float(dataset[name].values[at]) for name in names}
    n, w = (int(dataset[name].values[at]) for name in ("n", "w"))
    return {
        "id": k + 1,
        "kind": KINDS[int(dataset["kind"].values[at])],
        "n": n or None,
        "w": w if n else None,
        **{name: None if math.isnan(value) else value for name, value in values.items()},
        "ci95": binomial_ci95(values["fraction"], int(dataset.attrs["cells"])).tolist(),
    }


def summary(dataset: xr.Dataset) -> list[str]:
    """Return the findings, a sentence a line."""
    a = facts(dataset)
    every = attractors(dataset)
    spans = [span(dim, *dataset[dim].values[[0, -1]]) for dim in varied_names(dataset)]
    counts = f"{counted(a['models'], 'map')} of {counted(a['cells'], 'start')}"
    lines = [f"{', '.join(spans)}: {counts}, {counted(len(every), 'attractor')}."]
    most = sorted(every, key=lambda one: -one["largest_fraction"])
    for one in most[:_LISTED]:
        ends = [span(dim, *limits) for dim, limits in one["ranges"].items()]
        share = percent(100 * one["largest_fraction"])
        bound = bound_said(one["largest_fraction"], a["cells"])
        lines.append(f"{one['name']}: {', '.join(ends)}, up to {share} of the starts{bound}.")
    if len(every) > _LISTED:
        lines.append(f"{len(every) - _LISTED} more attractors are in the result.")
    chaos = int((dataset["plane"].values == PLANES.index("only_chaos")).sum())
    if chaos:
        lines.append(f"Chaos attracts every start in {counted(chaos, 'map')}.")
    checked = dataset["unreliable"].values
    checked = checked[np.isfinite(checked)]
    if checked.size:
        lines.append(
            f"Labels checked in {counted(checked.size, 'map')}, the first of each block: half the "
            f"step or mirroring changes up to {percent(100 * checked.max())}."
        )
    lines += [
        f"{percent(100 * a[f'{key}_share'])} of the starts {word}."
        for key, word in (("undecided", "undecided"), ("failed", "failed or diverged"))
        if a[f"{key}_share"] > 0
    ]
    lines.append(
        f"Error after 5 periods up to {a['reached_error']:.2g}; "
        f"{a['seconds']:.1f} s on {counted(a['threads'], 'thread')}."
    )
    return lines
