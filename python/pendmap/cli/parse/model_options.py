"""Options of the model: its parameters, a preset, a model file."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.parse.options import MODEL, SI, added, option
from pendmap.cli.parse.signature import parameters
from pendmap.cli.parse.types import (
    ENDS,
    FILE,
    NUMBER,
    NUMBER_OR_ENDS,
    NUMBER_OR_RANGE,
    RANGE,
    AxisText,
)
from pendmap.errors import InputError
from pendmap.model import PRESETS, Pendulum, Rig, load_model
from pendmap.model.labels import LABELS
from pendmap.model.quantities import check

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., Any]

_BARE = ("gamma", "p", "omega", "phase", "torque", "theta_r")
_SI = ("c_over_m", "Tr", "stroke_mm", "frequency_hz")
_SAME = {"c_over_m": "gamma", "Tr": "theta_r", "stroke_mm": "p", "frequency_hz": "omega"}


def varied_model_options(function: Command, *, ends: bool = False) -> Command:
    """Add the options of the model; ranges among them become ``ranges``, in the order typed.

    Ranges are values, or two ``ends`` alone.
    """

    @functools.wraps(function)
    def with_ranges(**given: Any) -> Any:  # noqa: ANN401 (as the command)
        ranges: dict[str, AxisText] = {}
        for name, value in list(given.items()):
            if name in _BARE + _SI and isinstance(value, AxisText):
                ranges[name], given[name] = value, None
            for other, span in value if name == "vary" else ():
                if other in ranges:
                    raise click.UsageError(f"--vary {other} must be given once, got it twice")
                ranges[other] = span
        given.pop("vary")
        frequency = next((n for n in ("omega", "Omega", "frequency_hz") if n in ranges), None)
        drive = ("p", "stroke_mm", "omega", "frequency_hz")
        typed = {name for name in drive if given[name] is not None}
        if frequency is not None and typed in ({"p"}, {"stroke_mm"}):
            # A drive needs a frequency, which a model without drive lacks.
            first = ranges[frequency].low
            which = "omega" if frequency == "omega" else "frequency_hz"
            given[which] = first / math.tau if frequency == "Omega" else first
        return function(**given, ranges=ranges)

    vary = option(
        "--vary",
        (str, ENDS if ends else RANGE),
        f"A parameter that varies, {'' if ends else 'N values '}from A to B: p, omega, ...,"
        " EFFECT.PARAMETER; of a model in SI also Omega, c_over_m, Tr, phi, stroke_mm, and"
        " frequency_hz, where the stroke is constant if the model gives it, else p.",
        nargs=2,
        multiple=True,
        metavar="NAME A:B" if ends else "NAME A:B:N",
        group=MODEL,
    )
    return model_options(vary(with_ranges), NUMBER_OR_ENDS if ends else NUMBER_OR_RANGE)


def model_options(
    function: Command, kind: click.ParamType[Any] = NUMBER, left_out: tuple[str, ...] = ()
) -> Command:
    """Add the options of parameters, preset and model file, without those ``left_out``."""
    model = option(
        "--model model",
        FILE,
        "Model file, without dimensions or in SI; options given in addition override it. In SI "
        "times are in s and velocities in rad/s; the options from --gamma to --theta-r have "
        "no dimensions there either.",
        group=SI,
    )
    preset = option(
        "--preset", click.Choice(sorted(PRESETS)), "A point of the paper's figure 2.", group=MODEL
    )
    declared = parameters("model.pendulum.Pendulum")
    bare = [
        option(_typed(name), kind, f"{text}  [default: {declared[name].default:g}]", group=MODEL)
        for name in _BARE
        if name not in left_out
        for text in [declared[name].help]
    ]
    si = [
        option(_typed(name), kind, f"{meaning[0].upper()}{meaning[1:]}, {unit}.", group=SI)
        for name in _SI
        if name not in left_out
        for _, unit, meaning in [LABELS[name]]
    ]
    return added(*bare, preset, model, *si)(function)


def _typed(name: str) -> str:
    """Return the option of a parameter, and its name."""
    return f"--{name.replace('_', '-').lower()} {name}"


def model_from(given: dict[str, Any]) -> Pendulum | Rig:
    """Remove the model's options from ``given`` and return the model that they describe."""
    model, preset = given.pop("model"), given.pop("preset")
    typed = {name: given.pop(name, None) for name in (*_BARE, *_SI)}
    typed = {name: value for name, value in typed.items() if value is not None}
    if model is not None and preset is not None:
        raise click.UsageError("one of --model and --preset must be left out, got both")
    for one, other in _SAME.items():
        option, same = (f"--{n.replace('_', '-').lower()}" for n in (one, other))
        if one in typed and other in typed:
            raise click.UsageError(f"one of {option} and {same} must be left out, got both")
        if one in typed and model is None:
            raise click.UsageError(f"{option} must have --model of a file in SI; here it is {same}")
    for name in _SI:
        if name in typed:
            check(name, typed[name])
    bare = {name: value for name, value in typed.items() if name in _BARE}
    base = dataclasses.replace(PRESETS[preset] if preset else Pendulum(), **bare)
    return base if model is None else load_model(model, typed)


def rig_from(path: Path) -> Rig:
    """Read a model file that must be in SI; otherwise raise an error that names what it lacks."""
    model = load_model(path)
    if not isinstance(model, Rig):
        raise InputError(
            f"{path}: has no dimensions, it must be a model in SI: in [pendulum] w0 in rad/s, "
            "c_over_m = gamma w0 and Tr = theta_r w0^2 in the place of gamma and theta_r; pendmap "
            "identify writes one"
        )
    return model
