"""Commands that read a file whose columns, units or clock cannot be recognised."""

from __future__ import annotations

import shlex
from typing import Final

FRAME: Final = "DataFrame"  # Name of a record that has no file


def by_hand(where: str, **options: object) -> str:
    """Return the command with which a file is read by hand, to end a message.

    >>> by_hand("run 1.csv", time=1, angle="theta 2", angle_unit="deg")
    "pendmap look 'run 1.csv' --time 1 --angle 'theta 2' --angle-unit deg"
    """
    if where == FRAME:
        given = (f", {name}={value!r}" for name, value in options.items())
        return f"pendmap.read_experiment({where}{''.join(given)})"
    words = ["pendmap", "look", where]
    for name, value in options.items():
        words += ["--" + name.replace("_", "-"), str(value)]
    return shlex.join(words)
