"""Commands of analyses: options of the model, of the analysis and of the outputs."""

from __future__ import annotations

import concurrent.futures
import contextlib
import dataclasses
import importlib
import inspect
import logging
import multiprocessing
import os
import signal
import threading
from typing import TYPE_CHECKING, Any, Final

from pendmap import ANALYSES
from pendmap.cli.parse.groups import group, new_command
from pendmap.cli.parse.model_options import model_options
from pendmap.cli.parse.options import added, output_options, simd_option, store_options
from pendmap.cli.parse.signature import options_of, parameters
from pendmap.cli.parse.types import Address
from pendmap.cli.show import begin, made_here, show
from pendmap.cli.text import say
from pendmap.errors import MOST_WORKERS, InputError, check_whole, named, short_repr

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import click

    from pendmap.cli.parse.options import Decorator

_ANSWER: Final = 10  # Time in which a scheduler must answer, s
WRITES = """

Writes {0}.nc, {0}.png and {0}.rrd if no output is named."""
"""End of the help of every command that writes a result."""


def analysis_command(
    name: str,
    *options: Decorator | str,
    examples: Sequence[str],
    example: str = "",
    model: Decorator = model_options,
    stored: bool = False,
) -> Callable[[Callable[..., dict[str, Any]]], click.Command]:
    """Return a decorator that makes a command of :data:`pendmap.ANALYSES`.

    ``options`` are options, and names of parameters of the analysis (:func:`options_of`), which
    ``example`` shows. The decorated function takes model, outputs and their values, and returns the
    keyword arguments of the analysis; its docstring is the help, which ``examples`` end. What is
    ``stored`` is computed in tiles, by workers if they are given, and kept in a store if ``--out``
    names one.
    """
    kind, function = next(
        (k, functions[0]) for k, (which, functions, _) in ANALYSES.items() if which == name
    )
    path = f"analysis.{kind}.{function}"
    own_group = group("Analysis", example)

    def make(prepare: Callable[..., dict[str, Any]]) -> click.Command:
        def run(**given: Any) -> None:  # noqa: ANN401 (the options)
            resume, *workers = (given.pop(key, None) for key in ("resume", "workers", "scheduler"))
            chosen = {key: given.pop(key) for key in ("threads", "seed") if key in given}
            pendulum, outputs = begin(given, name, going_on=bool(resume))
            arguments = prepare(pendulum, outputs, **given)
            module = importlib.import_module(f"pendmap.analysis.{kind}")
            store = outputs.store if stored else None
            if arguments.get("draws") and not isinstance(store, Address):
                store = None  # draws are written when all are computed
            with (
                _workers(*workers, quiet=outputs.quiet) as executor,
                made_here(),
                outputs.progress(name) as progress,
            ):
                if runs:
                    from pendmap.analysis.run import RunOptions

                    run_options = {"store": store, "resume": bool(resume), "executor": executor}
                    arguments["run"] = RunOptions(progress=progress, **run_options, **chosen)
                dataset = getattr(module, function)(pendulum, **arguments)
            if store is None:
                show(dataset, outputs, module.SCHEMA)
            else:
                show(dataset, dataclasses.replace(outputs, out=None), module.SCHEMA, [str(store)])

        text = inspect.cleandoc(prepare.__doc__ or "") + WRITES.format(name)
        shown = [options_of(path, o, own_group) if isinstance(o, str) else o for o in options]
        runs = "run" in parameters(path)
        chosen = [options_of("analysis.run.RunOptions", "threads seed")] if runs else []
        tiles = [store_options] if stored else []
        files = output_options(stored=stored)
        decorate = added(model, *shown, *tiles, *chosen, simd_option, files)
        return new_command(name, *examples, text=text)(decorate(run))

    return make


@contextlib.contextmanager
def _workers(count: int | None, scheduler: str | None, *, quiet: bool) -> Iterator[Any]:
    """Yield processes for --workers, a Dask client for --scheduler, or None; say what lacks."""
    if scheduler is not None and count is not None:
        raise InputError("only one of scheduler and workers must be given, got both")
    if scheduler is not None:
        with named(f"scheduler {short_repr(scheduler)}"), _client(scheduler) as client:
            if not quiet and not client.nthreads():
                say(f"{scheduler} has no workers yet: waiting for them.", err=True)
            yield client
    elif count is not None:
        fresh = multiprocessing.get_context("spawn")
        count = check_whole("workers", count, 1, MOST_WORKERS)
        with concurrent.futures.ProcessPoolExecutor(count, fresh, _begin_worker) as pool:
            yield pool
    else:
        yield None


def _client(scheduler: str) -> Any:  # noqa: ANN401 (of Dask)
    """Return a client of a scheduler; InputError if it does not answer within seconds."""
    logging.disable()  # Dask would fill many lines when workers end
    try:
        import distributed

        return distributed.Client(scheduler, timeout=_ANSWER, set_as_default=False)
    except ImportError:
        raise InputError("must be left out without the extra pendmap[dask]") from None
    except Exception as error:
        raise InputError(f"is not reached: {error}") from error


def _begin_worker() -> None:
    """Leave Ctrl-C to the process that drives, and end with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
