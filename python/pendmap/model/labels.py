"""Units of what a fit finds, as people write them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

from pendmap.model import effects

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


_RAISED: Final = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")

_UNITS: Final = {
    "w0": "rad/s",
    "c_over_m": "1/s",
    "Tr": "rad/s\N{SUPERSCRIPT TWO}",
    "torque": "rad/s\N{SUPERSCRIPT TWO}",
    "offset": "rad",
    "tilt": "rad",
    "phi": "rad",
    "Omega": "rad/s",
}
"""Units of what is fitted, in SI."""


def unit_of(
    parameter: str, definition: Callable[[str], Mapping[str, Any]] = effects.definition
) -> str:
    """Return the unit in SI of what a fit calls this, as ``w0`` or ``quadratic_drag.q``.

    ``definition`` tells what is said of an effect, where there are others than the library's.
    """
    effect, _, own = parameter.partition("[")[0].rpartition(".")
    if not effect:
        return _UNITS.get(own, "")
    entries = definition(effect)["parameters"]
    unit = str(next(entry["unit"] for entry in entries if entry["name"] == own))
    return "" if unit == "1" else re.sub(r"\^(\d)", lambda m: m[1].translate(_RAISED), unit)
