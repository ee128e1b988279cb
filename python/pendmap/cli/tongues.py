"""``pendmap tongues``: critical curves of rest, hanging and inverted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.model_options import model_from, model_options_without
from pendmap.cli.options import (
    Outputs,
    draws_option,
    output_options,
    progress_options,
    seed_option,
)
from pendmap.cli.show import progress_bar, show
from pendmap.cli.types import NUMBER, VALUES

if TYPE_CHECKING:
    import xarray as xr


@click.command("tongues")
@model_options_without("omega", "frequency_hz")
@click.option(
    "--omega",
    "omegas",
    type=VALUES,
    help="Frequencies Omega/w0 of the drive.  [default: 0.5:3:200]",
)
@click.option("--p-max", type=NUMBER, default=6.0, help="Largest amplitude.  [default: 6]")
@click.option(
    "--plane",
    type=click.Choice(["omega-p", "e-alpha2"]),
    default="omega-p",
    help="What is drawn: that of eq. 1.2, or of eq. 1.4 with e = p/omega^2, alpha^2 = 1/omega^2.",
)
@draws_option
@seed_option("Draws the models.")
@progress_options
@output_options()
def command(**given: Any) -> None:  # noqa: ANN401 (the options above)
    """Find where rest, hanging and inverted, is stable: critical curves of eq. 1.3, exact.

    Also without damping; folds of the oscillation born there; curves by perturbation beside. For
    files, frequencies are added where curves turn, end or bend; --json lists those asked for.

    Writes tongues.nc, tongues.png and tongues.rrd if no output is named. --json alone writes no
    file.
    """
    file = given["model"]
    model = model_from(given)
    outputs = Outputs.take(given, "tongues", reads=[file])
    omegas = given.pop("omegas")

    from pendmap.analysis.tongues import tongues

    with progress_bar("tongues", shown=outputs.shows_progress) as progress:
        dataset = tongues(model, omegas, refine=outputs.draws, progress=progress, **given)
    show(dataset, outputs, fields)


def fields(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the JSON object of critical curves."""
    from pendmap.charts.tongues import by_frequency

    a = dataset.attrs
    omega = [float(w) for w in dataset["omega"].values]
    curves, undamped, inverted = (
        [
            {"omega": w, "p": [p for p, _ in row], "multiplier": [m for _, m in row]}
            for w, row in zip(omega, by_frequency(dataset, prefix, len(omega)), strict=True)
        ]
        for prefix in ("", "undamped_", "inverted_")
    )
    asked = dataset["asked"].values.astype(bool)
    for prefix, rest in (("", curves), ("inverted_", inverted)):
        stable = dataset[f"{prefix}stable_above"].values
        for k, curve in enumerate(rest):
            mine = dataset[f"{prefix}index"].values == k
            curve["stable_above"] = [bool(s) for s in stable[mine]]
    for k, curve in enumerate(curves):
        curve["fold"] = float(dataset["fold"].values[k])
    return {
        "units": a["units"],
        "curves": [curve for curve, mine in zip(curves, asked, strict=True) if mine],
        "inverted": [curve for curve, mine in zip(inverted, asked, strict=True) if mine],
        "undamped": [curve for curve, mine in zip(undamped, asked, strict=True) if mine],
        "asymptotic": {
            str(name): dataset["asymptotic"].values[k][asked].tolist()
            for k, name in enumerate(dataset["curve"].values)
        },
        **{name: a[name] for name in ("p_max", "seconds", "simd", "threads")},
        "summary": a["summary"].split("\n"),
    }
