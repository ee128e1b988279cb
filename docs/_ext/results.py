"""The page of results: variables, dimensions, units and meanings, from a small result of each kind.

Variables are those of the dataset; attributes and keys of the JSON object those of the schema, of
commands on records those of their table of keys.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import pendmap
from pendmap import Pendulum, Rig, Run
from pendmap.report.json_keys import KEYS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import xarray as xr

HERE = Path(__file__).resolve().parents[1]
INTRODUCTION = """# Variables and keys of results

Each result is a dataset by the CF conventions ([files](files.md)): `pendmap.load` returns it,
`dataset.pendmap.to_dataframe()` a table. A variable without dimensions is one number or text. The
last column says what is in the object that `--json` prints. What stands here are results of small
examples; models with effects, `draws=` and further options add variables.

Of commands on records ([look](#look), [identify](#identify), [compare](#compare),
[diagnose](#diagnose)) the keys of `--json` have a table of their own. `runs[].rms` is the key `rms`
of an item of the list `runs`; a part in capitals stands for names of parameters, effects, methods;
a key without a value is null. Booleans have the unit "no or yes", numbers without dimension 1, and
parameters the SI unit that [effects](effects/index.md) and [models](maps/models.md) state.
"""
RIG = Rig(w0=6.2, c_over_m=0.05, Tr=0.08)
BARE = Pendulum(p=0.6)
ANALYSES = {
    "trajectory": lambda: pendmap.simulate(BARE, 1.0, 0.0, 20.0, lyapunov=True),
    "basins": lambda: pendmap.basins(BARE, 10),
    "basin_sweep": lambda: pendmap.sweep(BARE, {"p": (0.5, 0.6, 2)}, grid=8),
    "parameter_map": lambda: pendmap.parameter_map(
        BARE, {"p": (0.3, 0.9, 2), "omega": (1.8, 2.0, 2)}, starts=2
    ),
    "bifurcation": lambda: pendmap.bifurcation(BARE, {"p": (0.5, 0.6, 2)}, starts=2),
    "continuation": lambda: pendmap.continuation(BARE, {"p": (0.3, 1.5)}, 1, 1, longest=1),
    "orbits": lambda: pendmap.orbit(BARE, 2, 0, pendmap.Grid.square(20)),
    "lyapunov": lambda: pendmap.lyapunov(BARE),
    "lifetime": lambda: pendmap.lifetime(BARE, starts=100),
    "tongues": lambda: pendmap.tongues(BARE, [1.9, 2.0]),
    "melnikov": lambda: pendmap.melnikov(BARE, [1.0, 2.0]),
}
RECORDS = {
    "identify": lambda: pendmap.identify(decay(2.0)),
    "compare": lambda: pendmap.compare(RIG, decay(2.0)),
    "diagnose": lambda: pendmap.diagnose([decay(2.0), decay(1.0)], max_effects=0),
}


def decay(release: float) -> Run:
    """Return a record with noise."""
    time = np.arange(0.0, 20.0, 0.02)
    theta = pendmap.simulate(RIG, release, 0.0, t_eval=time).theta.values
    theta = theta + np.random.default_rng(0).normal(0.0, 1e-3, time.size)
    return Run(f"from {release:g} rad", "a.csv", "free", time, theta, np.ones(time.size, bool))


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def variables(dataset: xr.Dataset, keys: frozenset[str]) -> Iterator[list[str]]:
    """Yield a row of each variable, those with dimensions first."""
    for name in sorted(dataset.variables, key=lambda name: not dataset[name].dims):
        about = dataset[name].attrs
        meaning = " ".join(
            filter(None, (about.get("long_name", "bounds of a cell"), about.get("comment")))
        )
        dims, unit = ", ".join(map(str, dataset[name].dims)), about.get("units", "")
        yield [f"`{name}`", dims, unit, meaning, "yes" if name in keys else ""]


def page() -> str:
    """Return the page."""
    parts = [INTRODUCTION]
    head = ["variable", "dimensions", "unit", "meaning", "JSON"]
    for kind, make in ANALYSES.items():
        schema: Any = importlib.import_module(f"pendmap.analysis.{kind}").SCHEMA
        dataset = make()
        keys = frozenset(field.place for field in schema.fields if field.json)
        attributes = [
            [f"`{f.name}`", f.unit, f.meaning, "yes" if f.json else ""]
            for f in schema.fields
            if f.place not in dataset.variables
        ]
        command, *_ = pendmap.ANALYSES[kind]
        parts += [f"## {command}\n", table(head, [*variables(dataset, keys)])]
        parts.append(table(["attribute or key", *head[2:]], attributes))
    for command, keys_of in KEYS.items():
        parts.append(f"## {command}\n")
        if command in RECORDS:
            dataset = RECORDS[command]().to_dataset()
            parts.append(table(head[:-1], [row[:-1] for row in variables(dataset, frozenset())]))
        rows = [[f"`{k.replace(', ', '`, `')}`", *about] for k, about in keys_of.items()]
        parts.append(table(["key of the JSON", *head[2:-1]], rows))
    return "\n".join(parts)


def write() -> None:
    """Write the page where its text has changed."""
    path, text = HERE / "results.md", page()
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
