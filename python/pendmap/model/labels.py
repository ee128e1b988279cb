"""Symbol, unit and meaning of every parameter of a pendulum."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final, NamedTuple

from pendmap.files.toml import packaged
from pendmap.model import effects

if TYPE_CHECKING:
    from collections.abc import Callable

    from pendmap.model.effects import EffectDefinition

_RAISED: Final = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


class Label(NamedTuple):
    """Symbol, unit and meaning of a parameter in figures, tables and messages."""

    symbol: str
    unit: str  # in ASCII; empty for a pure number
    meaning: str


_TABLES: Final = packaged("model/labels.toml")
QUANTITIES: Final[dict[str, tuple[str, str, str]]] = _TABLES.pop("quantities")
"""Unit, text and meaning of each quantity that follows from identified parameters."""
MATHTEXT: Final[dict[str, str]] = _TABLES.pop("mathtext")  # Form of the symbols of charts
LABELS: Final = {name: Label(*about) for name, about in _TABLES.items()}
"""Parameters of a :class:`pendmap.Rig` in SI, of a sensor, and of a :class:`pendmap.Pendulum`."""


def unit_of(
    parameter: str, definition: Callable[[str], EffectDefinition] = effects.definition
) -> str:
    """Return the SI unit, with raised digits, of ``w0``, ``phi[2]`` or ``EFFECT.PARAMETER``."""
    effect, _, name = parameter.partition("[")[0].rpartition(".")
    if not effect and name not in LABELS:
        return ""
    unit = definition(effect)[name].unit if effect else LABELS[name].unit
    return "" if unit == "1" else re.sub(r"\^(\d)", lambda m: m[1].translate(_RAISED), unit)
