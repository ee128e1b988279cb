"""Outputs of commands: progress, files, and on stdout JSON or text of 80 columns."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import importlib
import importlib.util
import itertools
import re
import shlex
import sys
import time
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import click

from pendmap.cli.parse.model_options import model_from
from pendmap.cli.parse.types import PICTURES, REPORTS, TABLES, default_file
from pendmap.errors import InputError, NotWrittenError, escaped, named, one_line
from pendmap.files import COMPLETE, held_interrupts
from pendmap.formatting import columns, duration, json_text, wrapped

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Sequence

    import xarray as xr

    from pendmap.analysis.result import Schema
    from pendmap.formatting import Readable
    from pendmap.model import Pendulum, Rig

    Write = Callable[[Path], Path | str]


_BOLD: Final = re.compile("(\x1b\\[[01]m)")  # What click.style writes
_LONG: Final = 60.0  # Time left that is worth a line, s
_SOON: Final = (3.0, 1e-4)  # Time, s, and share of the work from which on both tell the rest
_ENDS: Final = {
    "model": ".toml",
    "out": ".nc",
    "table": ".csv",
    "plot": ".png",
    "report": ".html",
    "rerun": ".rrd",
}
"""What a command may write, in this order, and the suffix of its default file."""
_KINDS: Final = {
    **dict.fromkeys(PICTURES, "plot"),
    **dict.fromkeys(REPORTS, "report"),
    **dict.fromkeys(TABLES, "table"),
    ".rrd": "rerun",
    ".toml": "model",
}
"""What a file of ``--out`` is, by its suffix; other files are the result itself."""
_WRITERS: Final = {
    "out": "files.dataset.save",
    "table": "identification.results.write_readings",
    "plot": "render.draw",
    "report": "render.write_report",
    "rerun": "viewer.view",
}
"""Functions that write a result; they import matplotlib and Rerun, if needed."""


def say(text: str, *, err: bool = False) -> None:
    """Write lines to stdout or stderr; those of more than 80 columns go on below, indented.

    Control characters, which names of files and columns may have, are escaped.
    """
    parts = enumerate(_BOLD.split(text))
    safe = "".join(part if place % 2 else escaped(part) for place, part in parts)
    click.echo(wrapped(safe), err=err)


def write_json(fields: dict[str, Any]) -> None:
    """Write one JSON object to stdout."""
    click.echo(json_text(fields))


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table with a bold header and aligned columns."""
    parts = (part.partition("\n") for part in columns(head, rows).split("\n\n"))
    return "\n\n".join(click.style(first, bold=True) + end + rest for first, end, rest in parts)


def first_of_all(result: Readable, first: Collection[str]) -> Iterator[str]:
    """Yield lines, then the tables and the other lines of a result's text."""
    yield from first
    tables, lines = result.text_parts()
    yield from (table(head, rows) for head, rows in tables if rows)
    yield from (line for line in lines if line not in first)


def command_line() -> str:
    """Return the command as it was typed."""
    return "pendmap " + shlex.join(sys.argv[1:])


def forecast(say: Callable[[str], object]) -> Callable[[int, int], None]:
    """Return a callback of progress that says once how long work of more than a minute takes.

    A part of a computation begins where the work done falls, or where its total changes.
    """
    began = since = time.monotonic()
    last = first = most = 0
    announced = False

    def report(done: int, total: int) -> None:
        nonlocal since, last, first, most, announced
        now = time.monotonic()
        if total != most or done < last:
            since, most, first = now, total, done
        last = done
        if announced or now - since < _SOON[0] or done - first < max(_SOON[1] * total, 1):
            return
        left = (now - since) * (total - done) / (done - first)
        announced = left > _LONG
        if announced:
            say(f"This takes about {duration(now - began + left)}.")

    return report


class File(NamedTuple):
    """A file to write."""

    kind: str  # key of _ENDS
    path: Path
    option: str = "--out"  # that names it


@dataclasses.dataclass(frozen=True)
class Outputs:
    """Output files and options of a command."""

    files: tuple[File, ...]
    view: bool = False
    as_json: bool = False
    quiet: bool = False
    left_out: str = ""
    kept: tuple[str, ...] = ()

    @classmethod
    def take(  # noqa: PLR0913 (by name)
        cls,
        given: dict[str, Any],
        name: str,
        reads: Iterable[Path | None] = (),
        *,
        default: Collection[str] = ("out", "plot", "rerun"),
        always: Collection[str] = (),
        going_on: bool = False,
    ) -> Outputs:
        """Remove the output options from ``given``; if none is given, the ``default`` is written.

        Without the viewer the recording is left out of it. A file that exists is kept, unless
        --overwrite is given or a run in it goes on.
        """
        named_files, overwrite = given.pop("out"), given.pop("overwrite")
        switches = {key: given.pop(key, False) for key in ("view", "as_json", "quiet")}
        options = {kind: given.pop(kind) for kind in _ENDS if kind in given}
        files = [File(kind, path, f"--{kind}") for kind, path in options.items() if path]
        files += [File(_KINDS.get(PurePath(p).suffix.lower(), "out"), p) for p in named_files]
        left_out, wanted = "", list(default)
        if files or switches["view"] or switches["as_json"]:
            wanted = [*always, *(["rerun"] if switches["view"] else [])]
            wanted = [kind for kind in wanted if kind not in {file.kind for file in files}]
        elif "rerun" in wanted and importlib.util.find_spec("rerun") is None:
            wanted.remove("rerun")
            left_out = f"{name}.rrd"
        free, there = free_name(name, [_ENDS[kind] for kind in wanted], overwrite=overwrite)
        defaults = [File(kind, default_file(free + _ENDS[kind])) for kind in wanted]
        every = sorted([*files, *defaults], key=lambda file: [*_ENDS].index(file.kind))
        keep_inputs(reads, every)
        if not overwrite and not going_on:
            keep_files(files)
        if switches["view"]:
            from pendmap import viewer

            with named("--view"):
                viewer.check_display()
        return cls(tuple(every), **switches, left_out=left_out, kept=there)

    def path(self, kind: str) -> Path | None:
        """Return the first file of a kind."""
        return next((file.path for file in self.files if file.kind == kind), None)

    @property
    def store(self) -> Path | None:
        """The Zarr store that --out names."""
        results = (file.path for file in self.files if file.kind == "out")
        return next((p for p in results if str(p).lower().rstrip("/").endswith(".zarr")), None)

    @contextlib.contextmanager
    def progress(self, name: str) -> Iterator[Callable[[int, int], None] | None]:
        """Yield the callback of progress, None with --quiet.

        On stderr a line tells the time of long work; a terminal has a bar with the time left.
        """
        if self.quiet:
            yield None
            return
        if not sys.stderr.isatty():
            yield forecast(functools.partial(click.echo, err=True))
            return
        from pendmap.engine.bar import ProgressBar

        with ProgressBar(name, leave=False) as bar:
            announce = forecast(functools.partial(bar.write, file=sys.stderr))

            def report(done: int, total: int) -> None:
                announce(done, total)
                bar(done, total)

            yield report

    def write(
        self,
        result: Any,  # noqa: ANN401 (a dataset, or what was found in records)
        model: Write | None = None,
        *,
        stored: Path | None = None,
        keep: bool = False,
        **look: Any,  # noqa: ANN401 (arguments of the figure)
    ) -> Written:
        """Write all files but that in which the result is ``stored``; ``model`` writes a model."""

        def writers() -> Iterator[tuple[Write, Path]]:
            for kind, path, _ in self.files:
                if path == stored:
                    continue
                if model is not None and kind == "model":
                    yield model, path
                    continue
                module, _, function = _WRITERS[kind].rpartition(".")
                write = getattr(importlib.import_module(f"pendmap.{module}"), function)
                yield functools.partial(write, result, **(look if kind == "plot" else {})), path

        return write_all(writers(), keep=keep)

    def finish(
        self, written: Written, fields: Callable[[], dict[str, Any]], lines: Iterable[str]
    ) -> None:
        """Print JSON or lines of text; raise an error if a file is missing; open the viewer."""
        if self.as_json:
            write_json(fields())
        elif not self.quiet:
            for line in lines:
                say(line)
            written.say()
            if written and self.kept:
                say(f"Kept: {', '.join(self.kept)} (--overwrite replaces)")
            if written and self.left_out:
                say(f"Left out: {self.left_out}, which needs the extra pendmap[viewer]")
        written.check()
        recording = written.name(self.path("rerun")) if self.view else None
        if recording is not None:
            from pendmap import viewer

            viewer.open_viewer(recording)


def begin(
    given: dict[str, Any], name: str, *, going_on: bool = False
) -> tuple[Pendulum | Rig, Outputs]:
    """Remove the options of model and outputs from ``given``; refuse the model's file as output."""
    file = given["model"]
    model = model_from(given)
    return model, Outputs.take(given, name, reads=[file], going_on=going_on)


def free_name(
    name: str, suffixes: Collection[str], *, overwrite: bool
) -> tuple[str, tuple[str, ...]]:
    """Return a name under which no file has these suffixes, and the files that have ``name``."""
    there = tuple(name + end for end in suffixes if Path(name + end).exists())
    if overwrite or not there:
        return name, ()
    numbered = (f"{name}-{number}" for number in itertools.count(2))
    return next(n for n in numbered if not any(Path(n + e).exists() for e in suffixes)), there


def keep_files(files: Iterable[File]) -> None:
    """Refuse files and stores that exist."""
    for _, path, option in files:
        if path.exists():
            raise click.UsageError(
                f"Invalid value for '{option}': {str(path)!r}: must be a new file, got one that"
                " exists: --overwrite replaces it"
            )


def keep_inputs(inputs: Iterable[Path | None], files: Iterable[File]) -> None:
    """Refuse outputs that are inputs, or folders of inputs."""
    read = [path for path in inputs if path is not None and path.exists()]
    for _, output, option in files:
        if not output.exists():
            continue
        folders = [folder for path in read for folder in path.resolve().parents]
        if any(output.samefile(p) for p in (folders if output.is_dir() else read)):
            raise click.UsageError(
                f"Invalid value for '{option}': {str(output)!r}: is an input, which"
                " would be lost: it must be another file"
            )


@contextlib.contextmanager
def made_here() -> Iterator[None]:
    """Let the ``history`` of results name this command."""
    from pendmap.files.dataset import made_by

    with made_by(command_line()):
        yield


def show(dataset: xr.Dataset, outputs: Outputs, schema: Schema, stored: Path | None = None) -> None:
    """Write the files asked for, then JSON or the summary to stdout; ``stored`` is its store."""
    complete = [] if stored is None else [str(stored)]
    COMPLETE.extend(complete)
    with made_here():
        written = outputs.write(dataset, stored=stored)
    written[:0] = complete
    lines = (dataset.attrs[name] for name in ("title", "summary"))
    outputs.finish(written, lambda: schema.json(dataset), lines)


class Written(list[str]):
    """Names of the files that are complete, and why others are not."""

    def __init__(self) -> None:
        super().__init__()
        self.missed: list[str] = []
        self.refused: list[InputError] = []

    def name(self, path: Path | None) -> str | None:
        """Return the name of a file if it is complete, else None."""
        return str(path) if str(path) in self else None

    def say(self) -> None:
        """Report the files that are complete, if any are."""
        if self:
            say("Written: " + ", ".join(map(one_line, self)))

    def check(self) -> None:
        """Raise an error if a file was refused, or could not be written to the disk.

        Input is bad only where nothing of the result is written.
        """
        if self.refused and not self:
            raise self.refused[0]
        if missed := [*map(str, self.refused), *self.missed]:
            complete = ", ".join(self) or "nothing"
            raise NotWrittenError(f"{'; '.join(missed)}; written: {complete}")


def write_all(files: Iterable[tuple[Write, Path]], *, keep: bool = False) -> Written:
    """Write files one after the other, with interrupts only between them; return their names.

    If the disk refuses one, the others are still written (:meth:`Written.check`). If a file cannot
    hold its content, InputError is raised and all files are removed, unless ``keep`` is True.
    """
    written = Written()
    for write, path in files:
        with held_interrupts():
            try:
                written.append(str(write(path)))
                COMPLETE.append(written[-1])
            except InputError as error:
                if not keep:
                    for name in written:
                        Path(name).unlink(missing_ok=True)
                        COMPLETE.remove(name)
                    raise
                written.refused.append(error)
            except OSError as error:
                written.missed.append(f"cannot write {path}: {error.strerror or error}")
    return written
