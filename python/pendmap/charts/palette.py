"""Colours and markers of attractors by their type, and of the methods of an identification.

The colours start from the palette of Okabe and Ito (2008), "Color universal design", which stays
distinguishable under the common colour deficiencies; the further ones differ in lightness as well
as in hue. Every kind has a family, and the direction and the period n choose within it.
After its last colour a family repeats, darker, then lighter, and so on (its lap). Attractors
around another turn of the line are coloured likewise. A colour does not depend on the other
attractors of a map, and no drawing library is imported.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pendmap.files.toml import packaged

if TYPE_CHECKING:
    from pendmap._core import Attractor

UNDECIDED = "#e4e4e4"  # Cells not decided within the bound (label 0)
FAILED = "#000000"  # Cells whose integration failed or diverged (label -1)
UNNAMED = "#8a8a8a"  # Attractors of unknown name and kind
_LINEAR = 0.04045  # Value of sRGB up to which it is proportional to luminance
CONTRAST = 2.0
"""Least contrast (WCAG 2.2) of points with a white ground; yellow has 1.3, sky blue 2.3."""

_TABLES: Final = packaged("charts/palette.toml")
_SHADES: Final = {
    family: [(f"#{one[:6]}", one[7:]) for one in text.split(", ")]
    for family, text in _TABLES["families"].items()
}
_NAMES: Final[dict[str, str]] = (
    dict(shade for shades in _SHADES.values() for shade in shades) | _TABLES["names"]
)

_SHAPES = {"oscillation": "sPXph8", "inverted_rest": "D"}  # Markers by kind; others have a disc
MARKERS: Final[dict[str, str]] = _TABLES["markers"]  # Of events, and of codimension 2
CURVES: Final = {kind: (str(one), tuple(dash)) for kind, (one, *dash) in _TABLES["curves"].items()}
"""Colour on maps and dash of curves by what happens there."""

_LAPS = ((0, 0.35), (255, 0.5), (0, 0.6), (255, 0.72), (0, 0.18), (255, 0.25))
"""Grey that a family's colours are mixed with on repetition, and its share."""

_SLOWER = 5  # Factor of the period of rotations of other than one turn a period


def colour(attractor: Attractor, further: int = 0) -> str:
    """Return the colour ``#rrggbb`` of an attractor, or the one ``further`` in its family."""
    code, times = _place(attractor, further)
    return _toward(code, *_LAPS[(times - 1) % len(_LAPS)]) if times else code


def parts(code: str) -> tuple[int, int, int]:
    """Return red, green and blue of ``"#rrggbb"``."""
    return int(code[1:3], 16), int(code[3:5], 16), int(code[5:7], 16)


def luminance(code: str) -> float:
    """Return the relative luminance of ``"#rrggbb"``, 0 to 1 (WCAG 2.2)."""
    srgb = np.array(parts(code)) / 255
    linear = np.where(srgb <= _LINEAR, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


@functools.cache
def on_white(code: str) -> str:
    """Return a colour ``"#rrggbb"`` for points and lines on white: darkened if it is too light."""
    shares = (k / 20 for k in range(20))
    dark = (_toward(code, 0, share) for share in shares)
    return next(one for one in dark if 1.05 / (luminance(one) + 0.05) >= CONTRAST)


def marker(attractor: Attractor) -> str:
    """Return the marker of an attractor; further ones where the colours repeat."""
    shapes = _SHAPES.get(attractor.kind, "o")
    if attractor.w and f"{attractor.kind} +" in _SHADES:
        shapes = "^>" if attractor.w > 0 else "v<"
    # The lap is how often the colours of a family were repeated before this one: usually 0.
    return shapes[_place(attractor)[1] % len(shapes)]


def in_words(code: str) -> str:
    """Return the name of a colour ``"#rrggbb"``, or of the nearest named one."""
    apart = [np.subtract(parts(one), parts(code)) for one in _NAMES]
    return [*_NAMES.values()][int(np.argmin([gap @ gap for gap in apart]))]


def shades(scale: str, at: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    """Return colours of a colour map, shape (n, 3), at places from 0 to 1."""
    colours = np.array(
        [parts(f"#{code}") for code in _TABLES["scales"][scale].split()], dtype=float
    )
    steps = np.linspace(0.0, 1.0, len(colours))
    mixed = [np.interp(np.asarray(at, dtype=float), steps, channel) for channel in colours.T]
    return np.round(np.stack(mixed, axis=-1)).astype(np.uint8)


def _toward(code: str, ground: int, part: float) -> str:
    """Return a colour mixed with a grey, 0 to 255, of this share."""
    mixed = (round((1 - part) * value + part * ground) for value in parts(code))
    return "#{:02x}{:02x}{:02x}".format(*mixed)


def _place(attractor: Attractor, further: int = 0) -> tuple[str, int]:
    """Return the colour of an attractor in its family, and the repetitions of the family."""
    kind, n, w = attractor.kind, attractor.n or 1, attractor.w
    side = f"{kind} {'-' if w < 0 else '+'}"
    if kind in _SHADES:
        family, step = _SHADES[kind], 0
    elif side in _SHADES:
        family, step = _SHADES[side], (n if abs(w) in (0, n) else _SLOWER * n) - 1
    else:
        family, step = _SHADES[f"oscillation {attractor.lean}"], n - 1
    around, at = divmod(step + further, len(family))
    # Turns +1, -1, +2, ... use successive laps.
    return family[at][0], around + 2 * abs(attractor.turn) - (attractor.turn > 0)


# Methods of an identification.

ODD, EVEN = "#d55e00", "#0072b2"
"""Colours of half cycles that begin at a peak of odd or even number."""
MEASURED: Final = "#222222"  # Colour of measured values
NOISE, NOISE_SAID = "#d9d9d9", "95 % of the readings' noise"
"""Colour and name of the band of the readings' noise."""


class Look(NamedTuple):
    """Name in a legend, colour ``#rrggbb`` and matplotlib dash of a method's line."""

    label: str
    colour: str
    dash: str = "-"


_LOOKS: Final = {method: Look(*about) for method, about in _TABLES["methods"].items()}
_OTHER: Final = "#8a8a8a"


def look(method: str) -> Look:
    """Return the look of a method; an unknown one is grey under its own name."""
    return _LOOKS.get(method) or Look(method.replace("_", " "), _OTHER)
