"""The group of commands, and what becomes of errors."""

from __future__ import annotations

import importlib
import os
import re
import signal
import sys
from typing import Any

import click

from pendmap.errors import InputError

__all__ = ["command", "run"]

BAD_INPUT = 2
INTERRUPTED = 130

_COMMANDS = {
    "info": "Show the version, the instruction set used, the threads.",
    "effects": "Show the library of effects: formula, parameters, which data reveal each.",
    "simulate": "Integrate one trajectory: time history, phase plane, Poincaré section.",
    "basins": "Map the basins of attraction.",
    "map": "Map which attractors exist over two parameters.",
    "bifurcation": "Draw stroboscopic points against a parameter, with hysteresis.",
    "orbit": "Find all periodic orbits of one period and winding, stable and unstable.",
    "lyapunov": "Find the largest Lyapunov exponent of the attractor that a start reaches.",
    "lifetime": "Measure how long transient chaos lives, or find that it persists.",
    "tongues": "Find where rest loses its stability: critical curves in two planes.",
    "melnikov": "Compute the homoclinic threshold by Melnikov's criterion.",
    "look": "Say what a record holds: channels, rate, noise, releases, what is odd about it.",
    "identify": "Find natural frequency, damping and friction in a free decay, by every method.",
    "compare": "Compare a model with records that it was not fitted to.",
    "diagnose": "Find where model and records disagree, and which effect is missing.",
    "rig": "Write an experiment of a virtual rig, its truth beside it.",
    "paper": "Draw a figure of the paper, by its number.",
    "plot": "Draw a result again, without computing.",
    "view": "Open a recording in the Rerun viewer.",
}


_NAMED = re.compile(r"(?P<name>\w+) is (?P<rest>[^:]+: .*)", re.DOTALL)
"""How everything below names what it refuses: ``gamma is -1: allowed is 0 or more``."""


class _ReaderGone(Exception):  # noqa: N818 (nothing is wrong)
    """Whoever reads stdout has seen enough; click would make a failed check of it, exit 1."""


class _Commands(click.Group):
    """Commands that are imported when they are called: ``--help`` imports none of them."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        if cmd_name not in _COMMANDS:
            return None
        module = importlib.import_module(f"pendmap.cli.{cmd_name}_command")
        loaded: click.Command = module.command
        return loaded

    def invoke(self, ctx: click.Context) -> Any:  # noqa: ANN401 (what the command returns)
        """Run the command; what it refuses is named as it was typed, by its option."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError:
            raise _ReaderGone from None
        except InputError as error:
            called = self.get_command(ctx, ctx.invoked_subcommand or "")
            options = {p.name: p.opts[0] for p in called.params} if called else {}
            named = _NAMED.fullmatch(str(error))
            if named is None or named["name"] not in options:
                raise
            option = options[named["name"]]
            raise click.UsageError(f"Invalid value for '{option}': {named['rest']}") from error

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        with formatter.section("Commands"):
            formatter.write_dl(list(_COMMANDS.items()))


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="pendmap", message="pendmap %(version)s")
def command() -> None:
    """Basin maps and attractors of parametrically excited pendulums.

    th'' + gamma th' + (1 + p cos(omega tau + phase)) sin th = torque - theta_r sign(th')
    """


def run() -> None:
    """Run the command line and exit: 0 done, 2 bad input, 130 interrupted."""
    sys.exit(_exit_code())


def _exit_code() -> int:  # noqa: PLR0911 (one for each way to end)
    try:
        result = command.main(prog_name="pendmap", standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return BAD_INPUT
    except click.ClickException as error:
        return _refuse(error.format_message())
    except InputError as error:
        return _refuse(str(error))
    except (click.Abort, KeyboardInterrupt) as stop:
        # click makes an Abort of the interrupt that names what is complete.
        files = (stop.__cause__ or stop.__context__ or stop).args
        click.echo(f"pendmap: interrupted, {', '.join(files) or 'nothing was'} written", err=True)
        return INTERRUPTED
    except _ReaderGone:
        # No message, and none from the interpreter at the end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE
    except MemoryError as error:
        return _refuse(f"not enough memory: {str(error) or 'choose a smaller grid'}")
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _refuse(f"{where}{error.strerror or error}")
    return result if isinstance(result, int) else 0


def _refuse(message: str) -> int:
    click.echo(f"pendmap: {' '.join(message.split())}", err=True)
    return BAD_INPUT
