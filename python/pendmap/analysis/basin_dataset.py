"""What a basin map has as variables: its cells, the counts and measures of its boundary."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.fractality import fitted_map, passes_log2
from pendmap.files.variables import variable
from pendmap.formatting import counted

if TYPE_CHECKING:
    from types import SimpleNamespace

    import xarray as xr

    from pendmap.units import Units

LAYERS: Final = {
    "basins": "labels",
    "only_chaos": "finite_time",
    "conservative": "finite_time",
}
"""What the cells of each plane are."""


def cells_of(raw: SimpleNamespace, dims: tuple[str, ...], units: Units) -> dict[str, Any]:
    """Return the variables with one value a start, over ``dims``."""
    finite_time = LAYERS[raw.plane] == "finite_time"
    when = "until settled"
    if finite_time:
        when = f"after {counted(raw.layer_periods, 'period')}"
    elif raw.longest_settle < 0:
        when = f"after {counted(raw.bound, 'period')}"
    cells: dict[str, Any] = {
        "label": variable(
            dims,
            raw.cells["label"],
            long_name="attractor",
            comment="number of the attractor; 0 undecided within the bound, -1 failed or diverged",
            flags=dict(enumerate(["failed", "undecided", *(a.name for a in raw.attractors)], -1)),
        ),
        "settle_periods": variable(
            dims,
            raw.cells["settle_periods"],
            "1",
            "periods until the trap of an attractor captures the trajectory",
            "-1 where no attractor captured it",
            missing=-1,
        ),
        "net_turns": variable(
            dims,
            raw.cells["net_turns"],
            "1",
            f"net turns {when}",
            "the angle's displacement over 2 pi, rounded",
        ),
    }
    if finite_time:
        values = raw.cells["finite_time_exponent"]
        name = f"finite-time Lyapunov exponent {when}"
        cells["finite_time_exponent"] = variable(dims, values, units.of_rate, name)
    return cells


def uncertain_starts(raw: SimpleNamespace) -> dict[str, Any]:
    """Return the counts of starts whose label changes nearby; none without a boundary."""
    if not raw.uncertainty["eps"].size:
        return {}
    what = "distance in sides of the window"
    return {
        "uncertainty_eps": variable("distance", raw.uncertainty["eps"], "1", what),
        "uncertain": variable(
            "distance",
            raw.uncertainty["uncertain"].astype(np.int64),
            "1",
            "starts with another label at this distance on one side or the other",
        ),
        "uncertainty_tried": variable(
            "distance",
            raw.uncertainty["tried"].astype(np.int64),
            "1",
            "starts with known ends, drawn anew for each distance; where drawn by "
            "strata, the equivalent number of evenly drawn starts",
        ),
    }


def boundary(dataset: xr.Dataset, raw: SimpleNamespace) -> dict[str, float | None]:
    """Return the measures of the boundary as facts, None without a boundary."""
    measures: dict[str, float | None] = {}
    if raw.texture.boundary_boxes:
        entropy, stderr = raw.texture.boundary_basin_entropy, raw.texture.boundary_stderr
        measures["boundary_basin_entropy"] = entropy
        measures["boundary_boxes"] = raw.texture.boundary_boxes
        measures["boundary_basin_entropy_stderr"] = stderr if math.isfinite(stderr) else None
        measures["log2_criterion"] = int(passes_log2(entropy, stderr))
    law = fitted_map(dataset) if "uncertainty_eps" in dataset else None
    if law is not None:
        measures["uncertainty_exponent"] = law.value
        measures["uncertainty_exponent_stderr"] = law.stderr
        measures["uncertainty_exponent_low"], measures["uncertainty_exponent_high"] = law.ci95
        measures["uncertainty_eps_low"] = float(law.eps[0])
        measures["uncertainty_eps_high"] = float(law.eps[law.scales - 1])
    return measures
