"""Commands of analyses: options of the model, of the analysis and of the outputs."""

from __future__ import annotations

import functools
import importlib
import inspect
from typing import TYPE_CHECKING, Any

from pendmap import ANALYSES
from pendmap.cli.parse.groups import new_command
from pendmap.cli.parse.model_options import model_options
from pendmap.cli.parse.options import (
    added,
    machine_options,
    output_options,
    store_options,
    worker_options,
)
from pendmap.cli.show import begin, made_here, show
from pendmap.cli.stored import Kept

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import click

    from pendmap.cli.parse.options import Decorator

WRITES = """

Writes {0}.nc, {0}.png and {0}.rrd if no output is named."""
"""End of the help of every command that writes a result."""


def analysis_command(
    name: str,
    *options: Decorator,
    examples: Sequence[str],
    model: Decorator = model_options,
    stored: bool = False,
) -> Callable[[Callable[..., dict[str, Any]]], click.Command]:
    """Return a decorator that makes a command of :data:`pendmap.ANALYSES`.

    The decorated function takes model, outputs and the values of ``options``, and returns the
    keyword arguments of the analysis; its docstring is the help, which ``examples`` end. What is
    ``stored`` is computed in tiles, by workers if they are given, and kept in a store if ``--out``
    names one.
    """
    kind, function = next((k, own[0]) for k, (which, own, _) in ANALYSES.items() if which == name)

    def make(prepare: Callable[..., dict[str, Any]]) -> click.Command:
        def run(**given: Any) -> None:  # noqa: ANN401 (the options)
            kept = Kept.take(given) if stored else None
            pendulum, outputs = begin(given, name, going_on=kept is not None and kept.goes_on)
            arguments = prepare(pendulum, outputs, **given)
            module = importlib.import_module(f"pendmap.analysis.{kind}")
            analysis = functools.partial(getattr(module, function), pendulum, **arguments)
            if kept is not None:
                kept.run(analysis, outputs, name, module.SCHEMA)
                return
            with outputs.progress(name) as progress, made_here():
                dataset = analysis(progress=progress)
            show(dataset, outputs, module.SCHEMA)

        text = inspect.cleandoc(prepare.__doc__ or "") + WRITES.format(name)
        kept = (store_options, worker_options) if stored else ()
        files = output_options(stored=stored)
        decorate = added(model, *options, *kept, machine_options, files)
        return new_command(name, *examples, text=text)(decorate(run))

    return make
