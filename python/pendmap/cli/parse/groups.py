"""Commands with examples, and the groups in which ``--help`` shows their options."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any, Final

import click
import cloup

from pendmap.cli.parse.types import FILE
from pendmap.formatting import WIDTH

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


def group(title: str, example: str) -> cloup.OptionGroup:
    """Return a group of options with an example of their use."""
    return cloup.OptionGroup(title, help=f"Example: {example}")


MODEL: Final = group("Model", "--p 1.7 --theta-r 0.05")
SI: Final = group("Model in SI", "--model rig.toml --tr 0.08")
STARTS: Final = group("Starts", "--theta=-pi:pi:400 --velocity=-3:3:200")
START: Final = group("Start", "--theta 2.5 --velocity 0")
ACCURACY: Final = group("Accuracy", "--tol 1e-8")
RANDOM: Final = group("Random numbers", "--seed 1")
LONG: Final = group("Long runs", "--out map.zarr --resume")
MACHINE: Final = group("Machine", "--simd portable")
OUTPUT: Final = group("Output", "--json > result.json")
RECORD: Final = group("Records", "--rate 100")


def argument(
    name: str,
    metavar: str,
    kind: click.ParamType[Any] | type = FILE,
    **more: Any,  # noqa: ANN401
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return an argument, a file by default."""
    return click.argument(name, metavar=metavar, type=kind, **more)


class Command(cloup.Command):
    """Command whose options stand in groups, and whose help ends with examples."""

    def __init__(self, *args: Any, examples: Sequence[str] = (), **kwargs: Any) -> None:  # noqa: ANN401
        super().__init__(*args, **kwargs)
        self.examples = tuple(examples)
        # A group is shared by commands, its options are not.
        self.option_groups = [copy.copy(group) for group in self.option_groups]

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the examples below the options."""
        super().format_epilog(ctx, formatter)
        if self.examples:
            with formatter.section("Examples"):
                formatter.write("".join(f"  {line}\n" for line in self.examples))


def new_command(
    name: str, *examples: str, text: str | None = None
) -> Callable[[Callable[..., Any]], Command]:
    """Return a decorator that makes a command; ``text`` is its help, by default the docstring."""
    settings = cloup.Context.settings(
        formatter_settings=cloup.HelpFormatter.settings(max_width=WIDTH, col1_max_width=28)
    )
    return cloup.command(name, cls=Command, examples=examples, context_settings=settings, help=text)
