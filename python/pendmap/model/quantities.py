"""Conversion of the notations of a rig's quantities: frequency or length, stroke or p."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError, check_number

if TYPE_CHECKING:
    from collections.abc import Mapping


GRAVITY: Final = 9.81  # Acceleration of gravity where none is given, m/s^2

GROUPS: Final[Mapping[str, tuple[str, ...]]] = {
    "w0": ("w0", "length_m"),
    "c_over_m": ("c_over_m", "zeta"),
    "Omega": ("Omega", "frequency_hz"),
    "p": ("p", "Y", "stroke_mm"),
}
"""Ways to write a quantity, by the name that a :class:`pendmap.Rig` has for it."""

OPTIONAL: Final = ("Tr", "torque", "phi", "lab_time_s", "gravity")
"""Quantities with one way to write them."""

_POSITIVE: Final = ("length_m", "gravity", "frequency_hz")
_W0: Final = (1e-6, 1e6)
_NOT_NEGATIVE: Final = ("c_over_m", "zeta", "Tr", "Omega", "Y", "stroke_mm")
_AGREE: Final = 1e-3  # Largest relative difference of two values of one quantity: rounded digits


def check(name: str, value: object) -> float:
    """Return a quantity as a float; raise InputError if it is outside its range."""
    number = check_number(name, value)
    low, high = _W0
    if name == "w0" and not low <= number <= high:
        raise InputError(f"w0 must be a number from {low:g} to {high:g} rad/s, got {number:g}")
    if name in _POSITIVE and number <= 0:
        raise InputError(f"{name} must be a number above 0, got {number:g}")
    if name in _NOT_NEGATIVE and number < 0:
        raise InputError(f"{name} must be 0 or more, got {number:g}")
    return number


def natural_frequency(given: Mapping[str, float]) -> float:
    """Return ``w0`` in rad/s, given directly or as ``sqrt(gravity / length_m)``."""
    ways = {}
    gravity = check("gravity", given.get("gravity", GRAVITY))
    if "w0" in given:
        ways["w0"] = check("w0", given["w0"])
    if "length_m" in given:
        length = check("length_m", given["length_m"])
        ways[f"sqrt(g/l) of length_m = {length:g} and gravity = {gravity:g}"] = math.sqrt(
            gravity / length
        )
    if not ways:
        raise InputError("w0 is missing: a model in SI needs w0 in rad/s, or length_m")
    return one("w0", ways)


def amplitude(stroke: float, omega: float, gravity: float) -> float:
    """Return ``p`` of a stroke in m at an angular frequency in rad/s."""
    return stroke * omega**2 / gravity


def stroke_of(given: Mapping[str, float]) -> float | None:
    """Return the stroke in m where it is given in the place of ``p``, else None."""
    if "p" in given or not {"Y", "stroke_mm"} & set(given):
        return None
    return given["Y"] if "Y" in given else given["stroke_mm"] * 1e-3


def resolve(given: Mapping[str, float]) -> dict[str, float]:
    """Return the numbers of a :class:`pendmap.Rig` from the quantities given.

    ``w0 = sqrt(gravity / length_m)``, ``c_over_m = 2 zeta w0``, ``Omega = 2 pi frequency_hz``,
    ``p = Y Omega**2 / gravity`` with ``Y = stroke_mm / 1000`` the amplitude of the pivot's motion.
    Two ways to write one quantity must agree to a thousandth; the rig's own name takes precedence.
    """
    checked = {name: check(name, value) for name, value in given.items()}
    w0 = check("w0", natural_frequency(checked))
    gravity = checked.get("gravity", GRAVITY)
    ways: dict[str, dict[str, float]] = {
        name: {name: checked[name]} if name in checked else {}
        for name in ("c_over_m", "Omega", "p")
    }
    if "zeta" in checked:
        zeta = checked["zeta"]
        ways["c_over_m"][f"2 zeta w0 of zeta = {zeta:g}"] = 2 * zeta * w0
    if "frequency_hz" in checked:
        hertz = checked["frequency_hz"]
        ways["Omega"][f"2 pi f of frequency_hz = {hertz:g}"] = math.tau * hertz
    for name, metre in (("Y", 1.0), ("stroke_mm", 1e-3)):
        if name not in checked:
            continue
        omega = one("Omega", ways["Omega"]) if ways["Omega"] else 0.0
        if omega == 0:
            raise InputError(f"{name} needs a frequency: Omega or frequency_hz must be given")
        others = f"{name} = {checked[name]:g}, Omega = {omega:g} and gravity = {gravity:g}"
        ways["p"][f"Y Omega^2/g of {others}"] = amplitude(checked[name] * metre, omega, gravity)
    result = {"w0": w0} | {name: checked[name] for name in OPTIONAL if name in checked}
    return result | {name: one(name, known) for name, known in ways.items() if known}


def one(name: str, ways: Mapping[str, float]) -> float:
    """Return the first of several values of one quantity; raise InputError if they disagree."""
    (first, value), *others = ways.items()
    for other, second in others:
        if abs(second - value) > _AGREE * max(abs(value), abs(second)):
            stated = f"{name} is {value:.6g}" + ("" if first == name else f" by {first}")
            raise InputError(
                f"{stated}, but {second:.6g} by {other}: they contradict, one of them must be left "
                "out"
            )
    return value


COUNTERPARTS: Final[Mapping[str, tuple[str, int]]] = {
    "gamma": ("c_over_m", 1),
    "p": ("p", 0),
    "omega": ("Omega", 1),
    "phase": ("phi", 0),
    "torque": ("torque", 2),
    "theta_r": ("Tr", 2),
    "lab_time": ("lab_time_s", -1),
}
"""Name in a :class:`Rig` of each parameter of a :class:`Pendulum`, and its power of ``w0``."""

SI_KEYS: Final = (*(name for ways in GROUPS.values() for name in ways), *OPTIONAL)
BARE_KEYS: Final = (*COUNTERPARTS, "zeta")
"""Keys of ``[pendulum]`` in a model file, in SI and without dimensions."""
