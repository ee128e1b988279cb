"""Symbol, unit and meaning of every parameter of a pendulum."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final, NamedTuple

from pendmap.model import effects

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pendmap.model.effects import EffectDefinition

_RAISED: Final = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


class Label(NamedTuple):
    """Symbol, unit and meaning of a parameter in figures, tables and messages."""

    symbol: str
    unit: str  # in ASCII; empty for a pure number
    meaning: str


LABELS: Final[Mapping[str, Label]] = {
    "w0": Label("w0", "rad/s", "natural frequency sqrt(g / l) of small swings"),
    "length_m": Label("l", "m", "equivalent length g / w0^2"),
    "c_over_m": Label("c/m", "1/s", "viscous damping c / m"),
    "zeta": Label("zeta", "", "damping ratio c / (2 m w0)"),
    "Omega": Label("\N{GREEK CAPITAL LETTER OMEGA}", "rad/s", "angular frequency of the drive"),
    "frequency_hz": Label("f", "Hz", "frequency of the drive"),
    "p": Label("p", "", "amplitude Y Omega^2 / g of the pivot's vertical acceleration"),
    "Y": Label("Y", "m", "amplitude of the pivot's vertical motion"),
    "stroke_mm": Label("Y", "mm", "amplitude of the pivot's vertical motion"),
    "Tr": Label("Tr", "rad/s^2", "Coulomb friction over the moment of inertia"),
    "torque": Label("torque", "rad/s^2", "constant torque over the moment of inertia"),
    "phi": Label("\N{GREEK SMALL LETTER PHI}", "rad", "phase of the drive at t = 0"),
    "lab_time_s": Label("lab time", "s", "time in the laboratory at t = 0"),
    "gravity": Label("g", "m/s^2", "acceleration of gravity"),
    "offset": Label("offset", "rad", "reading of the sensor at the lowest point"),
    "tilt": Label("tilt", "rad", "inclination of the rig"),
    "gamma": Label("\N{GREEK SMALL LETTER GAMMA}", "", "viscous damping c / (m w0)"),
    "omega": Label("\N{GREEK SMALL LETTER OMEGA}", "", "frequency Omega / w0 of the drive"),
    "phase": Label("\N{GREEK SMALL LETTER PHI}", "rad", "phase of the drive at tau = 0"),
    "theta_r": Label("\N{GREEK SMALL LETTER THETA}r", "", "Coulomb friction Tr / w0^2"),
    "lab_time": Label("lab time", "", "time in the laboratory at tau = 0, times w0"),
}
"""Parameters of a :class:`pendmap.Rig` in SI, of a sensor, and of a :class:`pendmap.Pendulum`.

``p`` and ``torque`` have one name in both; without dimensions ``torque`` is a pure number.
"""


def unit_of(
    parameter: str, definition: Callable[[str], EffectDefinition] = effects.definition
) -> str:
    """Return the SI unit, with raised digits, of ``w0``, ``phi[2]`` or ``EFFECT.PARAMETER``."""
    effect, _, name = parameter.partition("[")[0].rpartition(".")
    if not effect and name not in LABELS:
        return ""
    unit = definition(effect)[name].unit if effect else LABELS[name].unit
    return "" if unit == "1" else re.sub(r"\^(\d)", lambda m: m[1].translate(_RAISED), unit)
