"""``pendmap rig``: experiments from the virtual rig."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.parse.groups import PRINTED, argument, group, new_command
from pendmap.cli.parse.options import flag, option, printed_options
from pendmap.cli.parse.types import EFFECT, FILE, NUMBER, PICTURES, output_file
from pendmap.cli.show import keep_files, write_all
from pendmap.cli.text import say, write_json
from pendmap.formatting import counted

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pendmap import virtual_rig


_RUNS = group("Runs", "--free 3 --forced 2 --duration 40")
_HIDDEN = group("Hidden effects", "--effect quadratic_drag --seed 3")
_RIG = group("Rig", "--w0 6.2 --c-over-m 0.05 --tr 0.08")
_SENSOR = group("Sensor", "--noise 0.2 --counts 1024")


@new_command(
    "rig",
    "pendmap rig free_decay --free 3 --out decay",
    "pendmap rig hidden --effect quadratic_drag --seed 3 --out hidden",
)
@argument("name", "[free_decay|forced|hidden]", str, required=False)
@option("--free", int, "Free decays.  [default: 1; forced: 0; hidden: 5]", group=_RUNS)
@option("--forced", int, "Runs under drive.  [default: 0; forced and hidden: 4]", group=_RUNS)
@option(
    "--duration",
    NUMBER,
    "Of each run, s.  [default: until rest; forced: 30 to 40; hidden: 15 to 30]",
    group=_RUNS,
)
@option("--seed", click.IntRange(min=0), "Draws all.", 0, group=_RUNS)
@option(
    "--effect effects",
    EFFECT,
    "Effect to hide, more than once for several: a name of --list, also with its parameters"
    " (magnet:dipole,amplitude=0.1,d=0.2), any (the seed chooses) or none.  [default: hidden: any]",
    multiple=True,
    group=_HIDDEN,
)
@option("--size", NUMBER, "Scales drawn effects.", 1.0, group=_HIDDEN)
@option(
    "--mess",
    NUMBER,
    "Weak disturbances in addition to the effects (texture of the bearing, drifting zero, slow "
    "noise), in multiples of the noise.",
    0.0,
    group=_HIDDEN,
)
@flag("--list listing", "List the effects and stop.", group=_HIDDEN)
@option("--w0", NUMBER, "Natural frequency, rad/s.  [default: 6.0 to 6.4]", group=_RIG)
@option(
    "--c-over-m",
    NUMBER,
    "Viscous damping, 1/s.  [default: about 0.05; 0.05 to 0.1]",
    group=_RIG,
)
@option(
    "--tr friction",
    NUMBER,
    "Coulomb friction Tr, rad/s^2.  [default: about 0.08; 0.05 to 0.1]",
    group=_RIG,
)
@option("--theta-r", NUMBER, "The same without dimensions: Tr/w0^2.", group=_RIG)
@option("--noise", NUMBER, "Degrees.  [default: 0.1; hidden: 0.05 to 0.5]", group=_SENSOR)
@option("--correlation", NUMBER, "AR(1) of the noise.", 0.0, group=_SENSOR)
@option("--counts", int, "A turn; 0: no steps.", 4096, group=_SENSOR)
@option("--rate", NUMBER, "Samples a second, Hz.", 100.0, group=_SENSOR)
@option("--jitter", NUMBER, "Of the clock, s rms.", 0.0, group=_SENSOR)
@option("--dropouts", NUMBER, "Share of samples lost.", 0.0, group=_SENSOR)
@option("--outliers", NUMBER, "Share that is false.", 0.0, group=_SENSOR)
@option("--out", FILE, "Folder to write.", metavar="DIR", group=PRINTED)
@option("--plot", output_file(*PICTURES), "Figure of the records: .png .svg .pdf.", group=PRINTED)
@flag(
    "--overwrite --replace overwrite",
    "Replace an experiment or a figure that is there.",
    group=PRINTED,
)
@printed_options(PRINTED)
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
    request = _request(name, given)
    if out is None:
        raise click.UsageError("--out DIR is missing")
    where = virtual_rig.places(out, replace=overwrite)
    if plot is not None and not overwrite:
        keep_files({plot: "--plot"})
    experiment = virtual_rig.make(request)
    both = f"{where.experiment}, {where.truth}"

    def write(_: Path) -> str:
        virtual_rig.write(experiment, where)
        return both

    files: list[tuple[Callable[[Path], Path | str], Path]] = [(write, where.experiment)]
    if plot is not None:
        files.append((functools.partial(_draw, where.experiment), plot))
    written = write_all(files)
    whole, drawn = both in written, written.name(plot)
    if as_json:
        places = {"experiment": where.experiment, "truth": where.truth} if whole else {}
        named = {name: str(path) for name, path in places.items()}
        write_json(named | ({"plot": drawn} if drawn else {}))
    elif not quiet:
        if whole:
            seconds = sum(run.plan.duration for run in experiment.runs)
            runs = counted(len(experiment.runs), "run")
            say(f"Written: {where.experiment} ({runs}, {seconds:.0f} s)")
            say(f"The truth: {where.truth}")
        if drawn:
            say(f"The records: {drawn}")
    written.check()


def _draw(folder: Path, path: Path) -> Path:
    """Draw the records as ``pendmap look`` does, without hidden values."""
    from pendmap.records import read_experiment
    from pendmap.render import draw

    return draw(read_experiment(folder), path)


def _request(name: str | None, given: dict[str, Any]) -> virtual_rig.Request:
    from pendmap import virtual_rig

    if name is None:
        raise click.UsageError("NAME (free_decay, forced or hidden) is missing")
    return virtual_rig.Request(name, **given)


def _list(effects: list[dict[str, str]], *, as_json: bool) -> None:
    if as_json:
        write_json({"effects": effects})
        return
    for effect in effects:
        say(f"{effect['name']}\n    {effect['formula']}\n    {effect['parameters']}")
