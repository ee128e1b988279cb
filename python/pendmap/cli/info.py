"""``pendmap info``: version, instruction set and threads."""

from __future__ import annotations

import contextlib
import importlib.metadata
import json
import platform

import click

from pendmap.cli.parse.options import OUTPUT, flag, new_command

_DEPENDENCIES = "numpy scipy xarray pandas netcdf4 matplotlib rerun-sdk click cloup tqdm"


@new_command("info", "pendmap info --json")
@flag("--json as_json", "One JSON object on stdout.", group=OUTPUT)
def command(*, as_json: bool) -> None:
    """Show the version, the instruction set used, the threads."""
    from pendmap import _core
    from pendmap.errors import instruction_set

    versions: dict[str, str | None] = dict.fromkeys(_DEPENDENCIES.split())
    for name in versions:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            versions[name] = importlib.metadata.version(name)
    facts = {
        "version": _core.__version__,
        "simd": instruction_set(),
        "simd_available": _core.simd_available(),
        "threads": _core.default_threads(),
        "python": platform.python_version(),
        "versions": versions,
    }
    if as_json:
        click.echo(json.dumps(facts))
        return
    available = ", ".join(_core.simd_available())
    rows = {
        "instruction set": f"{facts['simd']} (here: {available}; --simd selects one)",
        "threads": facts["threads"],
        "Python": facts["python"],
    }
    click.echo(f"pendmap {facts['version']}")
    for name, value in (rows | versions).items():
        click.echo(f"{name:<17}{value or 'not installed'}")
