"""Commands of analyses: options of the model, of the analysis and of the outputs."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
from typing import TYPE_CHECKING, Any

from pendmap import ANALYSES
from pendmap.cli.parse.groups import group, new_command
from pendmap.cli.parse.model_options import model_options
from pendmap.cli.parse.options import added, output_options, resume_option, simd_option
from pendmap.cli.parse.signature import options_of, parameters
from pendmap.cli.parse.types import Address
from pendmap.cli.show import begin, made_here, show

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import click

    from pendmap.cli.parse.options import Decorator

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
    ``stored`` is computed in tiles, and kept in a store if ``--out`` names one.
    """
    kind, function = next(
        (k, functions[0]) for k, (which, functions, _) in ANALYSES.items() if which == name
    )
    path = f"analysis.{kind}.{function}"
    own_group = group("Analysis", example)

    def make(prepare: Callable[..., dict[str, Any]]) -> click.Command:
        def run(**given: Any) -> None:  # noqa: ANN401 (the options)
            resume = given.pop("resume", False)
            chosen: dict[str, Any] = {
                key: given.pop(key) for key in ("threads", "seed") if key in given
            }
            pendulum, outputs = begin(given, name, going_on=resume)
            arguments = prepare(pendulum, outputs, **given)
            module = importlib.import_module(f"pendmap.analysis.{kind}")
            store = outputs.store if stored else None
            if arguments.get("draws") and not isinstance(store, Address):
                store = None  # draws are written when all are computed
            with made_here(), outputs.progress(name) as progress:
                if runs:
                    from pendmap.analysis.run import RunOptions

                    chosen |= {"progress": progress, "store": store, "resume": resume}
                    arguments["run"] = RunOptions(**chosen)
                dataset = getattr(module, function)(pendulum, **arguments)
            if store is None:
                show(dataset, outputs, module.SCHEMA)
            else:
                show(dataset, dataclasses.replace(outputs, out=None), module.SCHEMA, [str(store)])

        text = inspect.cleandoc(prepare.__doc__ or "") + WRITES.format(name)
        shown = [options_of(path, o, own_group) if isinstance(o, str) else o for o in options]
        runs = "run" in parameters(path)
        chosen = [options_of("analysis.run.RunOptions", "threads seed")] if runs else []
        tiles = [resume_option] if stored else []
        files = output_options(stored=stored)
        decorate = added(model, *shown, *tiles, *chosen, simd_option, files)
        return new_command(name, *examples, text=text)(decorate(run))

    return make
