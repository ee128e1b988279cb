"""Options that mean the same everywhere."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pendmap.checks import MOST_THREADS
from pendmap.cli.types import NUMBER, OutputFile, Whole
from pendmap.model import PRESETS, Pendulum

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., Any]

__all__ = ["Outputs", "model_options", "output_options", "pendulum_from", "progress_options"]

_MODEL = {
    "gamma": "Viscous damping c/(m w0).",
    "p": "Amplitude Y Omega^2/g of the drive.",
    "omega": "Frequency Omega/w0 of the drive.",
    "phase": "Phase of the drive at tau = 0, rad.",
    "torque": "Constant torque over m l^2 w0^2.",
    "theta_r": "Coulomb friction Tr/w0^2.",
}


def model_options(function: Command) -> Command:
    """Add the parameters of the pendulum, the presets and the model file."""
    model = click.option(
        "--model",
        "model",
        type=click.Path(path_type=Path),
        metavar="FILE.toml",
        help="Model file; options typed beside it override it.",
    )
    preset = click.option(
        "--preset", type=click.Choice(sorted(PRESETS)), help="A point of the paper's figure 2."
    )
    function = model(preset(function))
    for name, text in reversed(_MODEL.items()):
        option = f"--{name.replace('_', '-')}"
        default = getattr(Pendulum(), name)
        function = click.option(
            option, type=NUMBER, default=None, help=f"{text}  [default: {default:g}]"
        )(function)
    return function


def pendulum_from(given: dict[str, Any]) -> Pendulum:
    """Take the model's options out of ``given`` and make the pendulum that they describe."""
    model, preset = given.pop("model"), given.pop("preset")
    typed = {name: given.pop(name) for name in _MODEL}
    if model is not None and preset is not None:
        raise click.UsageError("--model and --preset: allowed is one of them")
    if model is not None:
        base = Pendulum.from_toml(model)
    else:
        base = PRESETS[preset] if preset else Pendulum()
    return dataclasses.replace(base, **{k: v for k, v in typed.items() if v is not None})


def progress_options(function: Command) -> Command:
    """Add threads, seed and quiet."""
    threads = click.option(
        "--threads", type=Whole(1, MOST_THREADS), help="Threads.  [default: one a processor]"
    )
    quiet = click.option("--quiet", is_flag=True, help="No progress, no summary.")
    return threads(quiet(function))


def output_options(function: Command) -> Command:
    """Add --json, --out, --plot, --rerun and --view."""
    for option in (
        click.option(
            "--json", "as_json", is_flag=True, help="One JSON object on stdout; alone, no files."
        ),
        click.option("--view", is_flag=True, help="Write the recording and open the viewer on it."),
        click.option("--rerun", type=OutputFile([".rrd"]), help="Rerun recording: .rrd."),
        click.option(
            "--plot", type=OutputFile([".png", ".svg", ".pdf"]), help="Figure: .png .svg .pdf."
        ),
        click.option("--out", type=OutputFile([".nc", ".zarr"]), help="Result: .nc or .zarr."),
    ):
        function = option(function)
    return function


def _can_view() -> None:
    """Refuse --view before anything is computed where no window can open."""
    from pendmap import viewer

    try:
        viewer.check_display()
    except viewer.ViewerError as error:
        raise click.UsageError(f"--view: {error}") from error


@dataclasses.dataclass(frozen=True)
class Outputs:
    """What to write, and where."""

    out: Path | None
    plot: Path | None
    rerun: Path | None
    view: bool
    as_json: bool
    quiet: bool

    @classmethod
    def take(cls, given: dict[str, Any], name: str) -> Outputs:
        """Take the output options out of ``given``; with none, three files ``name.*``."""
        fields = {field.name: given.pop(field.name) for field in dataclasses.fields(cls)}
        outputs = cls(**fields)
        asked = (outputs.out, outputs.plot, outputs.rerun, outputs.view, outputs.as_json)
        if not any(asked):
            outputs = dataclasses.replace(
                outputs,
                out=OutputFile([".nc"]).convert(f"{name}.nc", None, None),
                plot=OutputFile([".png"]).convert(f"{name}.png", None, None),
                rerun=OutputFile([".rrd"]).convert(f"{name}.rrd", None, None),
            )
        if outputs.view and outputs.rerun is None:
            rrd = OutputFile([".rrd"]).convert(f"{name}.rrd", None, None)
            outputs = dataclasses.replace(outputs, rerun=rrd)
        if outputs.view:
            _can_view()
        return outputs

    @property
    def shows_progress(self) -> bool:
        """Whether stderr is a terminal and nobody asked for silence."""
        return sys.stderr.isatty() and not self.quiet
