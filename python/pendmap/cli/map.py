"""``pendmap map``: which attractors exist over two parameters."""

from __future__ import annotations

import math
from typing import Any

import click

from pendmap.cli.model_options import begin, varied_model_options
from pendmap.cli.options import draws_option, output_options, progress_options, search_options
from pendmap.cli.show import progress_bar, show


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
    ranges = given.pop("ranges")
    model, outputs = begin(given, "map")

    from pendmap.analysis.parameter_map import SCHEMA, parameter_map

    outputs.check_room(math.prod(span.cells for span in ranges.values()))
    with progress_bar("map", shown=outputs.shows_progress) as progress:
        dataset = parameter_map(model, ranges, progress=progress, **given)
    show(dataset, outputs, SCHEMA)
