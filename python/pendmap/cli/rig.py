"""``pendmap rig``: experiments from the virtual rig."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.parse import options
from pendmap.cli.parse.options import OUTPUT, argument, flag, group, option
from pendmap.cli.parse.signature import options_of
from pendmap.cli.parse.types import EFFECT, FOLDER, PICTURES, output_file
from pendmap.cli.show import File, keep_files, say, write_all, write_json
from pendmap.formatting import counted

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


_REQUEST = "virtual_rig.experiment.Request"
_HIDDEN = group("Hidden effects", "--effect quadratic_drag --seed 3")


@options.new_command(
    "rig",
    "pendmap rig free_decay --free 3 --out decay",
    "pendmap rig hidden --effect quadratic_drag --seed 3 --out hidden",
)
@argument("name", "[free_decay|forced|hidden]", str, required=False)
@options_of(
    _REQUEST, "free forced duration seed", group("Runs", "--free 3 --forced 2 --duration 40")
)
@options_of(_REQUEST, "effect=effects size", _HIDDEN, effects=EFFECT)
@flag("--list listing", "List the effects and stop.", group=_HIDDEN)
@options_of(
    _REQUEST, "w0 c_over_m tr=friction theta_r", group("Rig", "--w0 6.2 --c-over-m 0.05 --tr 0.08")
)
@options_of(
    _REQUEST,
    "noise correlation counts rate jitter dropouts outliers",
    group("Sensor", "--noise 0.2 --counts 1024"),
)
@option("--out", FOLDER, "Folder to write.", group=OUTPUT)
@option("--plot", output_file(*PICTURES), "Figure of the records: .png .svg .pdf.", group=OUTPUT)
@options.overwrite_option
@options.printed_options()
def command(  # noqa: PLR0913 (an option each)
    *,
    name: str | None,
    out: Path | None,
    plot: Path | None,
    overwrite: bool,
    listing: bool,
    as_json: bool,
    quiet: bool,
    **given: Any,  # noqa: ANN401 (the other options above)
) -> None:
    """Write an experiment of a virtual rig: records, and the truth in a file beside them.

    free_decay is one release near pi; forced are runs under drive; hidden has runs of both kinds
    and an effect in them that the paper's equation lacks. Hidden values are only in DIR.truth.toml.
    The same seed gives the same experiment.
    """
    from pendmap import virtual_rig

    if listing:
        _list(virtual_rig.describe(), as_json=as_json)
        return
    if name is None or out is None:
        lacking = "NAME (free_decay, forced or hidden)" if name is None else "--out DIR"
        raise click.UsageError(f"{lacking} is missing")
    request = virtual_rig.Request(name, **given)
    where = virtual_rig.places(out, replace=overwrite)
    if plot is not None and not overwrite:
        keep_files([File("plot", plot, "--plot")])
    experiment = virtual_rig.make(request)

    def write(_: Path) -> Path:
        virtual_rig.write(experiment, where)
        return where.experiment

    files: list[tuple[Callable[[Path], Path], Path]] = [(write, where.experiment)]
    if plot is not None:
        files.append((functools.partial(_draw, where.experiment), plot))
    written = write_all(files)
    made = {"experiment": where.experiment, "truth": where.truth} if written else {}
    made |= {"plot": plot} if plot is not None and written.name(plot) else {}
    if as_json:
        write_json({name: str(path) for name, path in made.items()})
    elif made and not quiet:
        seconds = sum(run.plan.duration for run in experiment.runs)
        runs = counted(len(experiment.runs), "run")
        say(f"Written: {where.experiment} ({runs}, {seconds:.0f} s)")
        say(f"The truth: {where.truth}")
        if "plot" in made:
            say(f"The records: {plot}")
    written.check()


def _draw(folder: Path, path: Path) -> Path:
    """Draw the records as ``look`` does, from their files: without hidden values."""
    from pendmap.records import read_experiment
    from pendmap.render import draw

    return draw(read_experiment(folder), path)


def _list(effects: list[dict[str, str]], *, as_json: bool) -> None:
    """Print name, formula and parameters of each effect."""
    if as_json:
        write_json({"effects": effects})
        return
    for effect in effects:
        say(f"{effect['name']}\n    {effect['formula']}\n    {effect['parameters']}")
