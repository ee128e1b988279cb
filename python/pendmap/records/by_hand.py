"""Commands that read a file whose columns, units or clock cannot be recognised."""

from __future__ import annotations

import contextlib
import shlex
from contextvars import ContextVar
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

FRAME: Final = "DataFrame"  # Name of a record that has no file
_GIVEN: Final = ContextVar[tuple[str, dict[str, object]]]("given", default=("", {}))


@contextlib.contextmanager
def given_by_hand(place: str, options: Mapping[str, object]) -> Iterator[None]:
    """Let commands repeat options that are given, and read a place, if any, instead of its file."""
    options = {name: value for name, value in options.items() if value is not None}
    token = _GIVEN.set((place, dict(options)))
    try:
        yield
    finally:
        _GIVEN.reset(token)


def by_hand(where: str, **options: object) -> str:
    """Return the command with which a file is read by hand, to end a message; of a table the call.

    >>> by_hand("run 1.csv", time=1, angle="theta 2", angle_unit="deg")
    "pendmap look 'run 1.csv' --time 1 --angle 'theta 2' --angle-unit deg"
    """
    place, given = _GIVEN.get()
    options = given | options
    if where == FRAME:
        call = (f", {name}={value!r}" for name, value in options.items())
        return f"pendmap.read_experiment({where}{''.join(call)})"
    words = ["pendmap", "look", place or where]
    for name, value in options.items():
        option = name.removesuffix("_s").removesuffix("_hz").replace("_", "-")
        words += [f"--{option}", f"{value:.12g}" if isinstance(value, float) else str(value)]
    return shlex.join(words)
