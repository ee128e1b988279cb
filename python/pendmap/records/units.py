"""Channels of a record, their units, and common column names."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

# Units of a recorded pivot: the SI unit and the factor to it
PIVOT_UNITS: Final = {
    "m/s2": ("m/s2", 1.0),
    "g": ("m/s2", 9.80665),
    "m/s": ("m/s", 1.0),
    "m": ("m", 1.0),
    "cm": ("m", 1e-2),
    "mm": ("m", 1e-3),
}
DEGREE: Final = math.pi / 180


@dataclasses.dataclass(frozen=True)
class Channel:
    """Quantity of a column, with its units and names."""

    unit: str  # in SI
    units: Mapping[str, float]  # factor to SI by plain spelling
    default: str  # usual heading
    names: str  # pattern of other names, plain (lower case, without unit)

    def factor(self, unit: str, where: str) -> float:
        """Return the factor from a unit to SI; raise InputError for other units."""
        spelled = spelling(unit)
        if spelled not in self.units:
            raise InputError(
                f"{where}: unit must be one of {', '.join(self.units)}, or have a scale beside it,"
                f" {self.unit} per unit, in [columns] of experiment.toml, got {unit!r}"
            )
        return self.units[spelled]

    def has(self, unit: str) -> bool:
        """Return whether a text is one of the channel's units, raw ones included."""
        return spelling(unit) in self.units or spelling(unit) in _RAW


_RAW: Final = ("v", "mv", "volt", "volts", "count", "counts", "tick", "ticks", "adc", "lsb")
_TIMES: Final = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds", "sek", "sekunden"), 1.0),
    **dict.fromkeys(("ms", "msec", "millis", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "usec", "micros", "microsecond", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nanoseconds"), 1e-9),
    **dict.fromkeys(("min", "minutes"), 60.0),
    **dict.fromkeys(("h", "hours"), 3600.0),
}
_ANGLES: Final = {
    **dict.fromkeys(("rad", "radian", "radians"), 1.0),
    "mrad": 1e-3,
    **dict.fromkeys(("deg", "degree", "degrees", "grad", "°"), DEGREE),
    **dict.fromkeys(("rev", "turn", "turns", "revolutions"), math.tau),
}
_SPEEDS: Final = {
    **dict.fromkeys(("rad/s", "rads", "1/s"), 1.0),
    "mrad/s": 1e-3,
    **dict.fromkeys(("deg/s", "°/s", "dps", "degs"), DEGREE),
    "rpm": math.tau / 60,
    **dict.fromkeys(("rev/s", "rps"), math.tau),
}
# Units of an angular acceleration, in rad/s^2
ANGULAR_ACCELERATIONS: Final = {
    **dict.fromkeys(("rad/s2", "1/s2"), 1.0),
    **dict.fromkeys(("deg/s2", "°/s2"), DEGREE),
}
_ACCELERATIONS: Final = {
    **dict.fromkeys(("m/s2", "m/s/s", "ms-2", "m/ss"), 1.0),
    "g": 9.80665,
    **ANGULAR_ACCELERATIONS,
}
_LENGTHS: Final = {
    **dict.fromkeys(("px", "pixel", "pixels"), 1.0),
    "m": 1.0,
    "cm": 1e-2,
    "mm": 1e-3,
}
# Channels by name, in the order in which columns are assigned
CHANNELS: Final = {
    "time": Channel(
        "s",
        _TIMES,
        "t_s",
        "t|time|zeit|temps|tiempo|tempo|time ?stamp|elapsed( time)?|clock|seconds_elapsed",
    ),
    "angle": Channel(
        "rad",
        _ANGLES,
        "theta_rad",
        "theta|θ|th|angle|winkel|alpha|phi|φ|encoder|ang(le)? ?pos(ition)?|angular position"
        "|volts?|voltage|counts?|adc",
    ),
    "velocity": Channel(
        "rad/s",
        _SPEEDS,
        "velocity_rad_s",
        "omega|ω|(angular )?velocity|theta ?dot|dtheta|gyro(scope)?( ?[xyz])?"
        "|rot(ation)? ?rate( ?[xyz])?|w[xyz]?|omega filtered",
    ),
    "acceleration": Channel(
        "m/s2",
        _ACCELERATIONS,
        "acceleration_m_s2",
        "((linear|angular) )?acc(el|eleration|elerometer)?( ?[xyz])?|a[xyz]?|theta ?ddot",
    ),
    "pixel_x": Channel("px", _LENGTHS, "pixel_x", "x|pixel ?x|x ?pixel|px x|pos ?x"),
    "pixel_y": Channel("px", _LENGTHS, "pixel_y", "y|pixel ?y|y ?pixel|px y|pos ?y"),
    "peaks": Channel("rad", _ANGLES, "peak_rad", "peaks?|amplitudes?|turning points?"),
    "trigger": Channel(
        "1", {"1": 1.0, "v": 1.0, "mv": 1e-3, "ttl": 1.0}, "trigger", "trigger|trig|sync|ttl"
    ),
}
_IN_BRACKETS: Final = re.compile(r"^(?P<name>.*?)\s*[\(\[\{](?P<unit>[^\)\]\}]*)[\)\]\}]\s*$")
_AFTER: Final = re.compile(r"^(?P<name>[^/]+?)\s*(?:/\s*|,\s*|\s+in\s+)(?P<unit>.+)$")
_BEHIND: Final = re.compile(r"^(?P<name>.+?)[_ ](?P<unit>[a-zµ°]+(?:_s2?)?)$", re.IGNORECASE)


def spelling(unit: str) -> str:
    """Return a unit in the spelling of the tables of units."""
    text = unit.strip().lower().replace("²", "2").replace("^", "").replace("**", "")
    text = text.replace("µ", "u").replace("μ", "u").replace("·", "").replace(" ", "")
    text = text.replace("º", "°").replace("s⁻¹", "/s").replace("s-1", "/s")
    return re.sub(r"_s(2?)$", r"/s\1", text)


def plain(name: str) -> str:
    """Return a name in the spelling of the patterns: lower case, single spaces."""
    return " ".join(name.strip().lower().replace("_", " ").replace("-", " ").split())


def name_and_unit(header: str) -> tuple[str, str | None]:
    """Return name and unit of a heading; None without a unit.

    >>> name_and_unit("Time (s)"), name_and_unit("t/ms"), name_and_unit("theta_rad")
    (('Time', 's'), ('t', 'ms'), ('theta', 'rad'))
    """
    for pattern in (_IN_BRACKETS, _AFTER, _BEHIND):
        match = pattern.match(header.strip())
        if match and any(c.has(match["unit"]) for c in CHANNELS.values()):
            return match["name"].strip(), match["unit"].strip()
    match = _IN_BRACKETS.match(header.strip())
    if match:  # an unknown unit is reported when it is needed
        return match["name"].strip(), match["unit"].strip() or None
    return header.strip(), None
