"""``pendmap effects``: the library of effects."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Any

import click

from pendmap.cli.parse.options import OUTPUT, argument, flag, new_command, option
from pendmap.cli.parse.types import EFFECT, FILE
from pendmap.cli.show import say, write_json
from pendmap.errors import escaped
from pendmap.files import toml_text

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.model.effects import EffectDefinition, EffectParameter

_NAMES = 23  # Width of the column of names
_MAPS = {"yes": "include it", "frozen": "evaluate it at lab_time", "no": "refuse it"}


@new_command(
    "effects",
    "pendmap effects",
    "pendmap effects stribeck_friction magnet",
    "pendmap effects --effects own.toml",
)
@argument("names", "[NAME]...", EFFECT, nargs=-1)
@option(
    "--effects path",
    FILE,
    "Show those of a file instead, its [[formula]]; they are checked.",
    group=OUTPUT,
)
@flag("--verbose", "Also parameters and which data reveal each.", group=OUTPUT)
@flag("--json as_json", "One JSON object on stdout.", group=OUTPUT)
def command(*, names: tuple[str, ...], path: Path | None, verbose: bool, as_json: bool) -> None:
    """Show the library of effects: formula, parameters, which data reveal each.

    The formulas are terms on the right of th'' = ..., with v = th'; those of drives give the motion
    of the pivot, those of readings what the sensor shows. In brackets: values of interest without
    dimensions, and the factor that converts them to those of a model file in SI. With NAMEs: all
    about these effects, with examples for a model file.
    """
    from pendmap.model import load_formulas
    from pendmap.model.effects import definition, effects

    formulas = [] if path is None else load_formulas(path)
    known = {formula.name: formula for formula in formulas}
    wanted = {name if name in known else definition(name).name for name in names}
    listed = effects() if path is None else [formula.definition for formula in formulas]
    shown = [effect for effect in listed if not wanted or effect.name in wanted]
    if as_json:
        write_json({"effects": [dataclasses.asdict(effect) for effect in shown]})
        return
    for group, members in itertools.groupby(shown, lambda effect: effect.group):
        say(click.style(group, bold=True))
        for effect in members:
            say(f"  {effect.name:<{_NAMES}} {effect.formula}")
            if verbose or wanted:
                for parameter in effect.parameters:
                    say(f"      {_parameter(parameter)}")
                maps = "ignore it" if group == "reading" else _MAPS[effect.mappable]
                say(f"      maps {maps}; revealed by {effect.revealed_by}")
    if wanted:
        say("\nIn a model file without dimensions, which simulate and basins take by --model:")
        for effect in shown:
            formula = {"formula": [known[effect.name].table]} if effect.name in known else {}
            text = toml_text(formula | {"effect": [_example(effect)]})
            click.echo(escaped(f"\n{text}".rstrip()))
    elif not verbose:
        say("\nAll about one: pendmap effects NAME; about all: pendmap effects --verbose")


def _parameter(parameter: EffectParameter) -> str:
    low, high = parameter.typical
    unit = "" if parameter.unit == "1" else parameter.unit
    power = f"{parameter.power_of_w0:g}"
    if parameter.power_of_w0_less:
        power = f"({power}-{parameter.power_of_w0_less})"
    if power == "0":
        values = f"{low:g} to {high:g} {unit}".rstrip()
    else:
        scale = "w0" if power == "1" else f"w0^{power}"
        values = f"{low:g} to {high:g}; in SI times {scale}, {unit}"
    return f"{parameter.name}, {parameter.role}: {parameter.meaning} ({values})"


def _example(effect: EffectDefinition) -> dict[str, Any]:
    """Return an effect of usual size as a table of a model file."""
    sizes = {}
    for parameter in effect.parameters:
        low, high = parameter.typical
        middle = math.sqrt(low * high) if low > 0 else high / 2
        sizes[parameter.name] = float(f"{middle:.1g}")
    return {"name": effect.name, "parameters": sizes}
