"""Commands that read a file whose columns, units or clock cannot be recognised."""

from __future__ import annotations

import shlex
from contextvars import ContextVar
from typing import Final

FRAME: Final = "DataFrame"  # Name of a record that has no file
GIVEN: Final = ContextVar[tuple[str, tuple[tuple[str, object], ...]]]("given", default=("", ()))
"""Folder whose description is read, if any, and the options given, which commands repeat."""


def by_hand(where: str, **options: object) -> str:
    """Return the command with which a file is read by hand, to end a message; of a table the call.

    >>> by_hand("run 1.csv", time=1, angle="theta 2", angle_unit="deg")
    "pendmap look 'run 1.csv' --time 1 --angle 'theta 2' --angle-unit deg"
    """
    place, given = GIVEN.get()
    options = dict(given) | options
    if where == FRAME:
        call = ", ".join(f"{name}={value!r}" for name, value in options.items())
        return f"pendmap.read_experiment({where}, {call})"
    words = ["pendmap", "look", place or where]
    for name, value in options.items():
        option = name.removesuffix("_s").removesuffix("_hz").replace("_", "-")
        words += [f"--{option}", f"{value:.12g}" if isinstance(value, float) else str(value)]
    return shlex.join(words)
