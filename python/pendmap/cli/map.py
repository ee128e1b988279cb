"""``pendmap map``: which attractors exist over two parameters."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.model_options import model_from, varied_model_options
from pendmap.cli.options import (
    Outputs,
    draws_option,
    output_options,
    progress_options,
    search_options,
)
from pendmap.cli.show import progress_bar, searched, show

if TYPE_CHECKING:
    import xarray as xr


@click.command("map")
@varied_model_options
@click.option(
    "--curves", is_flag=True, help="Draw the critical curves of rest over it (p and omega)."
)
@draws_option
@search_options
@progress_options
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Map which attractors exist over any two parameters.

    Two parameters are ranges A:B:N, like --p 0.05:2.5:200 --omega 0.5:3:200, or by name:
    --vary quadratic_drag.q 0:0.1:50. Writes map.nc, map.png and map.rrd if no output is named.
    --json alone writes no file.
    """
    file = given["model"]
    ranges = given.pop("ranges")
    model = model_from(given)
    outputs = Outputs.take(given, "map", reads=[file])

    from pendmap.analysis.parameter_map import parameter_map

    outputs.check_room(math.prod(span.cells for span in ranges.values()))
    with progress_bar("map", shown=outputs.shows_progress) as progress:
        dataset = parameter_map(model, ranges, progress=progress, **given)
    show(dataset, outputs, fields)


def fields(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the JSON object of a map over two parameters."""
    a = dataset.attrs
    regimes = [
        {"kinds": json.loads(str(kinds)), "share": float(share)}
        for kinds, share in zip(
            dataset["regime_kinds"].values, dataset["regime_share"].values, strict=True
        )
    ]
    return {
        "units": a["units"],
        "columns": a["columns"],
        "rows": a["rows"],
        "regimes": regimes,
        "cells": a["cells"],
        **searched(dataset),
    }
