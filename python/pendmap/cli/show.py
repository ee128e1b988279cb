"""Outputs of commands: progress, files, JSON and text."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import importlib
import importlib.util
import itertools
import shlex
import sys
import time
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any, Final

import click

from pendmap.cli.parse.model_options import model_from
from pendmap.cli.parse.options import RESULTS
from pendmap.cli.parse.types import PICTURES, REPORTS, Address, default_file
from pendmap.cli.text import say, write_json
from pendmap.errors import InputError, NotWrittenError, named, one_line
from pendmap.files import COMPLETE, check_room, held_interrupts
from pendmap.formatting import duration

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    import xarray as xr

    from pendmap.analysis.result import Schema
    from pendmap.model import Pendulum, Rig

    Write = Callable[[Path], Path | str]


_LONG: Final = 60.0  # Time left that is worth a line, s
_SOON: Final = (3.0, 1e-4)  # Time, s, and share of the work from which on both tell the rest
_LONGER: Final = 2.0  # Ratio of a new time to the one told that is worth another line


def forecast(say: Callable[[str], object]) -> Callable[[int, int], None]:
    """Return a callback of progress that says how long work of more than a minute takes.

    A part of a computation begins where the work done falls, or where its total changes. The time
    is said again where a later part makes it much longer.
    """
    began = since = time.monotonic()
    last, first, most, longest = 0, 0, 0, 0.0

    def report(done: int, total: int) -> None:
        nonlocal since, last, first, most, longest
        now = time.monotonic()
        if total != most or done < last:
            since, most, first = now, total, done
        last = done
        if now - since < _SOON[0] or done - first < max(_SOON[1] * total, 1):
            return
        left = (now - since) * (total - done) / (done - first)
        whole = now - began + left
        if left > _LONG and whole > _LONGER * longest:
            longest = whole
            say(f"This takes about {duration(whole)}.")

    return report


_FIELDS: Final = {
    **dict.fromkeys(PICTURES, "plot"),
    **dict.fromkeys(REPORTS, "report"),
    ".rrd": "rerun",
}
"""What a file of ``--out`` is, by its suffix; other files are the result itself."""


@dataclasses.dataclass(frozen=True)
class Outputs:
    """Output files and options of a command."""

    out: Path | Address | None = None
    whole: Path | None = None  # the whole result, where `out` is a model
    plot: Path | None = None
    report: Path | None = None
    rerun: Path | None = None
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
        suffix: str = RESULTS[0],
        reads: Iterable[Path | None] = (),
        *,
        default: bool | Collection[str] = True,
        going_on: bool = False,
    ) -> Outputs:
        """Remove the output options from ``given``; if none is given, by default all files.

        Names of ``default`` choose among these. Without the viewer the recording is left out of
        them. A file that exists is kept, unless --overwrite is given or a run in it goes on.
        """
        overwrite, named_files = given.pop("overwrite"), given.pop("out")
        fields = [field.name for field in dataclasses.fields(cls) if field.name in given]
        taken: dict[str, Any] = {field: given.pop(field) for field in fields} | {"out": None}
        options = {taken[f]: f"--{f}" for f in ("plot", "report", "rerun") if taken.get(f)}
        known = _FIELDS if suffix in RESULTS else {**_FIELDS, RESULTS[0]: "whole"}
        for path in named_files:
            field = known.get(PurePath(path).suffix.lower(), "out")
            if taken.get(field) is not None:
                raise click.UsageError(
                    f"one of {taken[field]} and {path} must be left out, got both"
                )
            taken[field] = path
            options[path] = "--out"
        files = {"out": suffix, "plot": ".png", "report": ".html", "rerun": ".rrd"}
        wanted = {f: end for f, end in files.items() if f in {*fields, "out"}}
        if not isinstance(default, bool):
            wanted = {f: end for f, end in wanted.items() if f in default}
        if not default or any(value for f, value in taken.items() if f != "quiet"):
            wanted = {}
            if taken.get("view") and taken["rerun"] is None:
                wanted["rerun"] = ".rrd"
            if "report" in taken and taken["out"] is None:  # a diagnosis always writes its model
                wanted["out"] = suffix
        elif "rerun" in wanted and importlib.util.find_spec("rerun") is None:
            taken["left_out"] = name + wanted.pop("rerun")
        free, there = free_name(name, wanted.values(), overwrite=overwrite)
        taken |= {f: default_file(free + end) for f, end in wanted.items()}
        outputs = cls(**taken, kept=there)
        keep_inputs(reads, outputs, options)
        if not overwrite and not going_on:
            keep_files(options)
        if outputs.view:
            from pendmap import viewer

            with named("--view"):
                viewer.check_display()
        return outputs

    def check_room(self, cells: int) -> None:
        """Refuse a map if the disk lacks half a byte a cell, the least compressed size."""
        for path in (self.out, self.rerun):
            if isinstance(path, Path):
                check_room(path, cells // 2)

    @property
    def draws(self) -> bool:
        """Whether a file, a figure or a recording is written."""
        return bool(self.out or self.plot or self.rerun or self.view)

    @property
    def store(self) -> Path | Address | None:
        """The Zarr store that --out names."""
        out = self.out
        zarr = isinstance(out, Address) or (out is not None and out.suffix.lower() == ".zarr")
        return out if zarr else None

    @property
    def shows_progress(self) -> bool:
        """Whether stderr is a terminal and --quiet is not given."""
        return sys.stderr.isatty() and not self.quiet

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
            announce = forecast(bar.write)

            def report(done: int, total: int) -> None:
                announce(done, total)
                bar(done, total)

            yield report

    def files(
        self,
        result: Any,  # noqa: ANN401 (a dataset, or what was found in records)
        save: Write | None,
        look: Mapping[str, Any] | None = None,
    ) -> Iterator[tuple[Write, Path]]:
        """Yield writer and path of each file; import matplotlib and Rerun only when needed.

        ``look`` has arguments of the figure.
        """
        if isinstance(self.out, Path) and save is not None:
            yield save, self.out
        if self.whole is not None:
            from pendmap.files import dataset

            yield functools.partial(dataset.save, result), self.whole
        for path, module, write in (
            (self.plot, "render", "draw"),
            (self.report, "render", "write_report"),
            (self.rerun, "viewer", "view"),
        ):
            if path is not None:
                home = importlib.import_module(f"pendmap.{module}")
                more = look or {} if write == "draw" else {}
                yield functools.partial(getattr(home, write), result, **more), path

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
        recording = written.name(self.rerun) if self.view else None
        if recording is not None:
            from pendmap import viewer

            viewer.open_viewer(recording)


def _report_files(report: Path) -> list[Path]:
    """Return the files of a report without its figures; a folder holds one of either kind."""
    in_folder = report.is_dir() or not report.suffix
    return [report / "report.html", report / "report.md"] if in_folder else [report]


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


def keep_files(options: Mapping[Path | Address, str]) -> None:
    """Refuse files and stores that exist, named by their option."""
    for path, option in options.items():
        if isinstance(path, Address):
            from pendmap.files.dataset import reached, sealed

            with reached(path):
                there = [str(path)] if sealed(path) else []
        else:
            files = _report_files(path) if option == "--report" else [path]
            there = [str(file) for file in files if file.exists()]
        for name in there:
            raise click.UsageError(
                f"Invalid value for '{option}': {name!r}: must be a new file, got one that exists:"
                " --overwrite replaces it"
            )


def keep_inputs(
    inputs: Iterable[Path | None], outputs: Outputs, options: Mapping[Path | Address, str]
) -> None:
    """Refuse outputs, named by their option, that are inputs or folders of inputs."""

    def lost(path: Path, output: Path) -> bool:
        places = [path, *path.resolve().parents] if output.is_dir() else [path]
        return any(output.samefile(place) for place in places)

    read = [path for path in inputs if path is not None and path.exists()]
    for named_file in (outputs.out, outputs.whole, outputs.plot, outputs.rerun, outputs.report):
        if not isinstance(named_file, Path):
            continue
        files = _report_files(named_file) if named_file is outputs.report else [named_file]
        for output in files:
            if output.exists() and any(lost(path, output) for path in read):
                raise click.UsageError(
                    f"Invalid value for '{options.get(named_file, '--out')}': {str(output)!r}: is"
                    " an input, which would be lost: it must be another file"
                )


@contextlib.contextmanager
def made_here() -> Iterator[None]:
    """Let the ``history`` of results name this command."""
    from pendmap.files.dataset import made_by

    with made_by("pendmap " + shlex.join(sys.argv[1:])):
        yield


def show(dataset: xr.Dataset, outputs: Outputs, schema: Schema, stored: Sequence[str] = ()) -> None:
    """Write the files asked for, then JSON or the summary to stdout; ``stored`` names stores."""
    from pendmap.files.dataset import save

    COMPLETE.extend(stored)
    with made_here():
        written = write_all(outputs.files(dataset, functools.partial(save, dataset)))
    written[:0] = stored
    lines = (dataset.attrs[name] for name in ("title", "summary"))
    outputs.finish(written, lambda: schema.json(dataset), lines)


class Written(list[str]):
    """Names of the files that are complete, and why others are not."""

    def __init__(self) -> None:
        super().__init__()
        self.missed: list[str] = []
        self.refused: list[InputError] = []

    def name(self, path: Path | Address | None) -> str | None:
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
