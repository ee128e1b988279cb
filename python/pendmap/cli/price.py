"""Estimated cost of a computation with small damping, on stderr before it begins."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Final

import click

from pendmap.formatting import counted

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pendmap.model import Pendulum, Rig

_TYPICAL: Final = 20  # Ratio of bound to typical settling time: 60 to 8 for gamma 0.01 to 0.0003
_BESIDE: Final = 5000  # Cost of the search for attractors and of the checks, in starts
_SAMPLE: Final = 960  # Number of starts in a measurement of speed
_LEAST_SECONDS: Final = 0.05  # Least time of a measurement of speed, s


def say(model: Pendulum | Rig, count: int, given: Mapping[str, Any], *, quiet: bool) -> None:
    """Report the periods and time of ``count`` starts if small damping raises the bound."""
    if quiet or given["max_periods"] is not None:
        return
    from pendmap import _core
    from pendmap.model import without_dimensions

    starts = count * (1 + (given["draws"] or 0))
    pendulum = without_dimensions(model)[0]
    try:
        bound, _, least = _core.bounds(pendulum)
        if bound == least:
            return
        speed = _speed(pendulum, given["tol"], given["threads"] or 0)
    except ValueError:
        return
    typical = bound // _TYPICAL
    first, last = (_duration((starts + _BESIDE) * periods / speed) for periods in (typical, bound))
    click.echo(
        f"Damping is small: each of {counted(starts, 'start')} has up to {bound} periods to "
        f"settle, {typical} are typical. That takes roughly {first}, and {last} if none settles; "
        "--max-periods sets another bound.",
        err=True,
    )


def _speed(pendulum: Pendulum, tol: float, threads: int) -> float:
    """Return the number of periods of single trajectories computed in a second."""
    import numpy as np

    from pendmap import _core

    draw = np.random.default_rng(0)
    theta, velocity = draw.uniform(-np.pi, np.pi, _SAMPLE), draw.uniform(-3.0, 3.0, _SAMPLE)
    steps, _ = _core.choose_steps(pendulum, theta[:100], velocity[:100], tol)
    periods = 4
    while True:
        began = time.perf_counter()
        _core.advance(pendulum, theta, velocity, periods, steps, threads)
        seconds = time.perf_counter() - began
        if seconds > _LEAST_SECONDS:
            return _SAMPLE * periods / seconds
        periods *= 4


def _duration(seconds: float) -> str:
    for size, word in ((86400.0, "day"), (3600.0, "hour"), (60.0, "minute")):
        if seconds >= size:
            return counted(round(seconds / size), word)
    return counted(max(1, round(seconds)), "second")
