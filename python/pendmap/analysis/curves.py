"""The bifurcation set of a plane: curves of folds, doublings and other events of orbits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import regions, result
from pendmap.analysis.result import rows
from pendmap.errors import InputError, check_whole, core_errors
from pendmap.files.variables import flag, variable
from pendmap.formatting import counted
from pendmap.model import without_dimensions
from pendmap.units import VELOCITY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.analysis.run import Numerics
    from pendmap.analysis.varied import Varied
    from pendmap.model import Pendulum, Rig
    from pendmap.units import Units

LONGEST = 16  # Longest period of orbits whose curves are followed, in forcing periods
LISTED = 16  # Largest number of points in a summary
CRITICALITY = {-1: "no meaning", 0: "subcritical", 1: "supercritical"}
JUMPS = {0: "none", 1: "fold", 2: "period_doubling", 3: "symmetry_breaking"}


def entries(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the curves for the JSON object."""
    if "curve_kind" not in dataset:
        return []
    names = ("kind", "n", "w", "symmetric", "begin", "end")
    listed = result.records(dataset, **{name: f"curve_{name}" for name in names})
    owner, varied = dataset["place_curve"].values, _varied(dataset)
    for number, entry in enumerate(listed):
        mine = owner == number
        entry["symmetric"] = bool(entry["symmetric"])
        entry["ends"] = [entry.pop("begin"), entry.pop("end")]
        jumps = (JUMPS[one] for one in dataset["place_jump"].values[mine].tolist())
        entry["jumps"] = [None if one == "none" else one for one in jumps]
        entry["values"] = {name: dataset[f"place_{name}"].values[mine].tolist() for name in varied}
    return listed


def points(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the points of codimension 2 for the JSON object."""
    if "degenerate_kind" not in dataset:
        return []
    names = ("kind", "n", "w", "theta", "velocity", "curve")
    listed = result.records(dataset, **{name: f"degenerate_{name}" for name in names})
    every = [dataset[f"degenerate_{name}"].values.tolist() for name in _varied(dataset)]
    for entry, values in zip(listed, zip(*every, strict=True), strict=True):
        entry["values"] = dict(zip(_varied(dataset), values, strict=True))
    return listed


def _varied(dataset: xr.Dataset) -> list[str]:
    """Return the names of the two parameters."""
    return str(dataset.attrs["varied"]).split(", ")


def in_plane(
    pendulum: Pendulum | Rig,
    axes: tuple[Varied, ...],
    longest: int,
    numerics: Numerics,
    *,
    counted: bool = False,
) -> tuple[xr.Dataset, dict[str, Any]]:
    """Return the curves in the plane of two axes as variables, and what was asked."""
    bare, units = without_dimensions(pendulum)
    longest = check_whole("up_to", longest, 1, LONGEST)
    if any(axis.values.size == 1 for axis in axes):
        raise InputError("curves must be over two ranges, got one value")
    parts = [(axis.values - axis.values[0]) / np.ptp(axis.values) for axis in axes]
    first, second = ((x.tolist(), axis.kernel) for x, axis in zip(parts, axes, strict=True))
    with core_errors():
        run = numerics.run
        raw = _core.bifurcation_set(
            bare, (first, second), longest, counted, run.workers, run.progress
        )
    data = variables(raw, axes, units)
    dataset = xr.Dataset(data | (regions.variables(raw, axes) if raw.types else {}))
    low, high = ([float(axis.values[end]) for axis in axes] for end in (0, -1))
    named = ", ".join(axis.name for axis in axes)
    asked = {"varied": named, "up_to": longest, "low": low, "high": high}
    return dataset, asked


def variables(raw: _core.BifurcationSet, axes: tuple[Varied, ...], units: Units) -> dict[str, Any]:
    """Return curves, their places and the points of codimension 2 as variables."""
    speed, unit = units.given(raw.velocity, VELOCITY), units.of_velocity
    owner, at = raw.curve, raw.degenerate_place.astype(np.int64)
    words = np.array(raw.ends, dtype=str).reshape(-1, 2)
    meets = np.array(raw.meets, dtype=np.int32).reshape(-1, 2)
    multipliers = raw.multipliers.reshape(-1, 2, 2)
    values = {}
    for axis, part in zip(axes, raw.at.reshape(-1, 2).T, strict=True):
        low, high = axis.values[[0, -1]]
        values[axis.name] = np.where(part < 1, low + (high - low) * part, high), axis.attributes
    data: dict[str, Any] = {
        "curve_kind": variable("curve", np.array(raw.kind, dtype=str), long_name="what happens"),
        "curve_n": variable("curve", raw.n, "periods", "smallest period"),
        "curve_w": variable("curve", raw.w, "turns", "net turns over it"),
        "curve_symmetric": flag("curve", raw.symmetric, "whether orbits are mirror symmetric"),
        "curve_begin": variable("curve", words[:, 0], long_name="why it ends at its beginning"),
        "curve_end": variable("curve", words[:, 1], long_name="why it ends"),
        **{
            f"curve_{name}_point": variable(
                "curve", meets[:, k], "1", f"point of codimension 2 at its {name}", "-1: none"
            )
            for k, name in enumerate(("begin", "end"))
        },
        "place_curve": variable("place", owner, "1", "number of the curve"),
        **{f"place_{name}": ("place", one, text) for name, (one, text) in values.items()},
        **result.point("place", raw.theta, speed, unit, "place_{}"),
        "place_multipliers": variable(
            ("place", "eigenvalue", "part"), multipliers, "1", "Floquet multiplier"
        ),
        "place_supercritical": flag(
            "place", raw.supercritical, "whether new orbits live beyond it", CRITICALITY
        ),
        "place_jump": flag("place", raw.jump, "what a jump of a multiplier does there", JUMPS),
        "degenerate_kind": variable(
            "degenerate", np.array(raw.degenerate_kind, dtype=str), long_name="what it is"
        ),
        "degenerate_curve": variable("degenerate", owner[at], "1", "number of the curve"),
        "degenerate_place": variable(
            "degenerate", raw.degenerate_place, "1", "number of the place"
        ),
        "degenerate_n": variable("degenerate", raw.n[owner[at]], "periods", "smallest period"),
        "degenerate_w": variable("degenerate", raw.w[owner[at]], "turns", "net turns over it"),
        **{f"degenerate_{n}": ("degenerate", one[at], text) for n, (one, text) in values.items()},
        **result.point("degenerate", raw.theta[at], speed[at], unit, "degenerate_{}"),
    }
    if not raw.sections:  # curves from points that were known
        return data
    held, where, orbits, new = zip(*raw.sections, strict=True)
    return data | {
        "section_held": variable("section", np.array(held, np.int32), "1", "axis that is held"),
        "section_part": variable("section", np.array(where), "1", "where, from 0 to 1"),
        "section_orbits": variable("section", np.array(orbits, np.int32), "1", "orbits found"),
        "section_new": variable("section", np.array(new, np.int32), "1", "new curves"),
    }


def summary(dataset: xr.Dataset) -> list[str]:
    """Return the lines that say what was found."""
    kinds = dataset["curve_kind"].values.tolist()
    of_kind = [
        f"{counted(kinds.count(kind), 'curve')} of "
        + f"{kind.replace('_', ' ')}s".replace("ys", "ies")
        for kind in dict.fromkeys(kinds)
    ]
    varied = _varied(dataset)
    longest = counted(dataset.attrs["up_to"], "period")
    lines = [f"{', '.join(of_kind) or 'No curves'} of orbits up to {longest}."]
    lines += degenerate_lines(dataset, varied)
    new = dataset["section_new"].values[::-1]
    quiet = int(np.argmax(new > 0)) if new.any() else new.size
    searched = counted(dataset.sizes["section"], "section")
    lines.append(f"Orbits were searched on {searched}; the last {quiet} had no new curve.")
    return lines


def degenerate_lines(dataset: xr.Dataset, varied: Sequence[str]) -> list[str]:
    """Return a line for each point of codimension 2 of a result, if it has curves."""
    if "degenerate_kind" not in dataset:
        return []
    lines, names = [], ("kind", "n", "w", *varied)
    for kind, n, w, *values in rows(dataset, *(f"degenerate_{name}" for name in names)):
        pairs = zip(varied, values, strict=True)
        where = ", ".join(f"{name} = {value:.12g}" for name, value in pairs)
        lines.append(f"{kind.replace('_', ' ')} of {n}:{w} at {where}.")
    more = len(lines) - LISTED
    return [*lines[:LISTED], *([f"{more} more points are in the result."] if more > 0 else [])]
