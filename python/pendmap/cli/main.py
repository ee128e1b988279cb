"""The group of commands, and the exit code of each error."""

from __future__ import annotations

import atexit
import contextlib
import difflib
import errno
import importlib
import os
import re
import signal
import sys
import threading
import warnings
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import shell_complete

from pendmap import ANALYSES
from pendmap.errors import FitDiverged, InputError, NotWrittenError, ViewerError, one_line
from pendmap.files import COMPLETE, STOPS
from pendmap.formatting import WIDTH

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from types import FrameType

FAILED = 1
BAD_INPUT = 2
INTERRUPTED = 130
_SHELL = "_PENDMAP_COMPLETE"  # Variable in which a shell asks for completion
_FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)
"""Error numbers of a full disk: the request itself was valid."""

_ANALYSES = {name: text for name, _, text in ANALYSES.values()}
_SECTIONS = {
    "Maps and motions": _ANALYSES,
    "Records": {
        "look": "Describe a record: channels, rate, noise, releases, faults.",
        "identify": "Find natural frequency, damping and friction in a free decay.",
        "compare": "Compare a model with records that it was not fitted to.",
        "diagnose": "Find where model and records disagree, and which effect is missing.",
        "effects": "Show the library of effects: formula, parameters, which data reveal each.",
        "rig": "Write an experiment of a virtual rig, with its true parameters.",
    },
    "Other": {
        "paper": "Draw a figure of the paper, by its number.",
        "plot": "Draw a result again, without computing.",
        "view": "Open a recording in the Rerun viewer.",
        "info": "Show the version, the instruction set used, the threads.",
    },
}
"""Sections of --help: commands and their descriptions."""
_COMMANDS = [name for commands in _SECTIONS.values() for name in commands]
_NAMED = re.compile(
    r"(?P<name>\w+) (?:is (?=[^:]+: )|(?=must (?:be|have|hold) ))(?P<rest>.*)", re.DOTALL
)
"""Form of messages that refuse a value: ``gamma must be 0 or more, got -1``."""


class _Commands(click.Group):
    """Group whose commands are imported only when called: ``--help`` imports none of them."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return _COMMANDS

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            if ctx.resilient_parsing:  # a shell completes the name
                return None
            near = difflib.get_close_matches(cmd_name, _COMMANDS, n=1)
            known = f"like {near[0]}" if near else "one of those that pendmap --help lists"
            raise click.UsageError(f"command must be {known}, got {cmd_name!r}")
        if cmd_name in _ANALYSES:
            from pendmap.cli.analysis import command_of

            return command_of(cmd_name)
        module = importlib.import_module(f"pendmap.cli.{cmd_name}")
        loaded: click.Command = module.command
        return loaded

    def invoke(self, ctx: click.Context) -> Any:  # noqa: ANN401 (what the command returns)
        """Run the command; a refused value is named by its option."""
        try:
            return super().invoke(ctx)
        except InputError as error:
            called = self.get_command(ctx, ctx.invoked_subcommand or "")
            options = {p.name: p.opts[0] for p in called.params} if called else {}
            named = _NAMED.fullmatch(str(error))
            if named is None or named["name"] not in options:
                raise
            option = options[named["name"]]
            raise click.UsageError(f"Invalid value for '{option}': {named['rest']}") from error

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, commands in _SECTIONS.items():
            with formatter.section(title):
                formatter.write_dl([*commands.items()], col_max=12)
        with formatter.section("Examples"):
            for line in ("pendmap basins --p 1.7", "pendmap identify run.csv"):
                formatter.write(f"  {line}\n")
        formatter.write("\npendmap COMMAND --help shows the options of a command.\n")


@click.group(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": WIDTH},
)
@click.version_option(package_name="pendmap", message="pendmap %(version)s")
def command() -> None:
    """Basin maps and attractors of parametrically excited pendulums.

    th'' + gamma th' + (1 + p cos(omega tau + phase)) sin th = torque - theta_r sign(th')
    """


def run() -> None:
    """Run the command line and exit: 0 done, 1 not all of it, 2 bad input, 130 interrupted.

    SIGTERM and SIGHUP, which schedulers and terminals send, stop it like Ctrl-C.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # warnings of libraries are for developers
    os.environ["MPLBACKEND"] = "agg"  # figures are written to files, without windows
    stops: list[int] = []
    code = 0
    try:
        with _stoppable(stops):
            code = _exit_code(stops)
    except KeyboardInterrupt:
        # The interrupt came while the handlers were set, or removed.
        code = code if code == INTERRUPTED else _interrupted()
    if stops and code == INTERRUPTED:
        # A library that was interrupted, for example during its import, may crash when the
        # interpreter shuts down.
        with contextlib.suppress(OSError):
            sys.stdout.flush()
        os._exit(code)
    sys.exit(_flushed(code))


def _flushed(code: int) -> int:
    """Flush stdout; if that fails, keep the interpreter from reporting it again at exit."""
    try:
        if sys.stdout is not None:  # it may be closed
            sys.stdout.flush()
    except OSError as error:
        if not code:
            _say(error.strerror or str(error))
        _silence()
        return code or FAILED
    return code


def _silence() -> None:
    """Discard all that is still written to stdout."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextlib.contextmanager
def _stoppable(stops: list[int]) -> Iterator[None]:
    """Convert SIGINT, SIGTERM and SIGHUP to KeyboardInterrupt; append them to ``stops``."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, _: FrameType | None) -> None:
        stops.append(number)
        raise KeyboardInterrupt

    def again(ignored: sys.UnraisableHookArgs) -> None:
        # Python ignores exceptions raised in finalizers: the interrupt is repeated.
        if isinstance(ignored.exc_value, KeyboardInterrupt) and hasattr(signal, "setitimer"):
            signal.signal(signal.SIGALRM, stop)
            signal.setitimer(signal.ITIMER_REAL, 0.01)
        else:
            sys.__unraisablehook__(ignored)

    usual = (signal.SIG_DFL, signal.default_int_handler)
    before = {n: signal.getsignal(n) for n in STOPS if signal.getsignal(n) in usual}
    for number in before:
        signal.signal(number, stop)
    hook, sys.unraisablehook = sys.unraisablehook, again
    # At exit an interrupt is ignored.
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)


def _exit_code(stops: Sequence[int]) -> int:
    COMPLETE.clear()
    try:
        if request := os.environ.get(_SHELL):
            return shell_complete(command, {}, "pendmap", _SHELL, request)
        # Not by click's main, which takes the unexpected end of any file for an interrupt.
        with command.make_context("pendmap", sys.argv[1:]) as context:
            command.invoke(context)
    except click.exceptions.Exit as end:
        return end.exit_code
    except KeyboardInterrupt:
        return _interrupted()
    except Exception as error:  # noqa: BLE001 (distinguished by _failed)
        # After a signal, an error of a library, for example during its import, is due to the
        # signal, except that a stopped trajectory is written and may not fit the disk.
        if stops and not isinstance(error, NotWrittenError):
            return _interrupted()
        return _failed(error)
    return 0


def _interrupted() -> int:
    _say(f"interrupted, {', '.join(COMPLETE) or 'nothing was'} written")
    return INTERRUPTED


def _failed(error: BaseException) -> int:
    code, message = BAD_INPUT, str(error)
    match error:
        case click.exceptions.NoArgsIsHelpError():
            click.echo(error.format_message(), err=True)
            return code
        case BrokenPipeError():
            # The reader is gone: no message, and none from the interpreter at exit.
            _silence()
            return 128 + signal.SIGPIPE
        case click.ClickException():
            message = error.format_message()
        case FitDiverged() | InputError() | ViewerError():
            pass
        case MemoryError():
            message = f"not enough memory: {message or 'choose a smaller grid'}"
        case NotWrittenError():
            code = FAILED
        case OSError():
            where = f"{error.filename}: " if error.filename else ""
            message = f"{where}{error.strerror or error}"
            code = FAILED if error.errno in _FULL else BAD_INPUT
        case _:
            raise error
    _say(message)
    return code


def _say(message: str) -> None:
    click.echo(f"pendmap: {one_line(message)}", err=True)
