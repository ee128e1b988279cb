"""``pendmap effects``: the library of effects."""

from __future__ import annotations

import dataclasses
import json
import sys
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from pendmap.model.library import EffectDefinition, EffectParameter

__all__ = ["command"]


@click.command("effects")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def command(*, names: tuple[str, ...], as_json: bool) -> None:
    """Show the library of effects: formula, parameters, which data reveal each.

    The formulas stand on the right of th'' = ..., with v = th'. Units are those of SI, typical
    values (in brackets) without dimensions. With NAMEs those alone.
    """
    from pendmap.cli.show import plain
    from pendmap.model.effects import definition
    from pendmap.model.library import effects

    wanted = {definition(name)["name"] for name in names}
    shown = [effect for effect in effects() if not wanted or effect.name in wanted]
    if as_json:
        table = [plain(dataclasses.asdict(effect)) for effect in shown]
        click.echo(json.dumps({"effects": table}, allow_nan=False))
    elif sys.stdout.isatty():
        _draw(shown)
    else:
        for effect in shown:
            _write(effect)


def _draw(effects: list[EffectDefinition]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table("effect", "formula", "parameters", "revealed by", "maps")
    for effect in effects:
        parameters = "\n".join(_parameter(parameter) for parameter in effect.parameters)
        cells = (effect.name, effect.formula, parameters, effect.revealed_by, effect.mappable)
        # Not markup: a formula may have brackets.
        table.add_row(*(Text(cell) for cell in cells))
    Console().print(table)


def _write(effect: EffectDefinition) -> None:
    click.echo(f"{effect.name:<24} {effect.formula}")
    for parameter in effect.parameters:
        click.echo(f"{'':<26} {_parameter(parameter)}")
    click.echo(f"{'':<26} {effect.group}, in maps: {effect.mappable}; {effect.revealed_by}")


def _parameter(parameter: EffectParameter) -> str:
    low, high = parameter.typical
    unit = "" if parameter.unit == "1" else f" [{parameter.unit}]"
    return f"{parameter.name}{unit}: {parameter.meaning} ({low:g} to {high:g})"
