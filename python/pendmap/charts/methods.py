"""Names and colours of identification methods, and items shared by their panels."""

from __future__ import annotations

import dataclasses
import textwrap
from typing import TYPE_CHECKING, Final

from pendmap.charts.chart import Chart, bare
from pendmap.charts.marks import QUIET, Text

if TYPE_CHECKING:
    from collections.abc import Iterable

ODD: Final = "#d55e00"
EVEN: Final = "#0072b2"
"""Colours of half cycles that begin at a peak of odd or even number."""
MEASURED: Final = "#222222"
"""Colour of measured values."""
NOISE: Final = "#d9d9d9"
NOISE_SAID: Final = "95 % of the readings' noise"
"""Colour and name of the band of the readings' noise."""


@dataclasses.dataclass(frozen=True)
class Look:
    """Name in a legend, colour ``#rrggbb`` and matplotlib dash of a method's line."""

    label: str
    colour: str
    dash: str = "-"


_LOOKS: Final = {
    "trajectory": Look("trajectory", "#0072b2"),
    "combined": Look("combined, as printed", "#d55e00"),
    "combined_odd_ends": Look("combined, odd ends", "#7a2a00", "-."),
    "combined_odd_triplets": Look("combined, odd triplets", "#f0a070", ":"),
    "combined_repaired": Look("combined, repaired", "#009e73", "--"),
    "log_decrement": Look("log decrement", "#e69f00"),
    "de_paula": Look("de Paula", "#cc79a7"),
    "energy_balance": Look("energy balance", "#56b4e9", "--"),
    "model": Look("model", "#0072b2"),
    "before": Look("before", "#d55e00"),
    "baseline": Look("baseline", "#d55e00"),
    "after": Look("after", "#0072b2"),
}
"""Colours of Okabe and Ito for methods drawn together."""
_OTHER: Final = "#8a8a8a"
_READINGS: Final = ("combined", "combined_odd_ends", "combined_odd_triplets")
"""Variants of the printed method; if the first is not applicable, another is drawn instead."""


def look(method: str) -> Look:
    """Return the look of a method; an unknown one is grey under its own name."""
    return _LOOKS.get(method) or Look(method.replace("_", " "), _OTHER)


def drawn(methods: Iterable[str]) -> list[str]:
    """Return the methods to draw: all but further variants of the printed one."""
    there = list(methods)
    printed = [name for name in _READINGS if name in there][:1]
    return [name for name in there if name not in _READINGS or name in printed]


def nothing(title: str, why: str, letters: int = 90) -> Chart:
    """Return a chart with the reason for an empty figure, in lines of at most ``letters``."""
    why = textwrap.fill(f"{why[:1].upper()}{why[1:].rstrip('.')}.", letters)
    words = Text(0.0, 0.0, why, colour=QUIET, align=("left", "top"))
    return Chart(title, "", [[bare("nothing", words)]], size=(8.6, 0.9))
