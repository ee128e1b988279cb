"""Colours: distinguishable with every kind of colour vision, and assigned by type alone."""

from __future__ import annotations

import itertools

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import pytest

from pendmap._core import Attractor
from pendmap.charts import palette

# Machado, Oliveira and Fernandes (2009): protanopia, deuteranopia, tritanopia, on linear RGB.
DEFICIENCIES = {
    "none": np.eye(3),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "tritanopia": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}
REST, TUMBLING = Attractor("rest", 1), Attractor("tumbling_chaos")
FORWARD, BACKWARD = Attractor("rotation", 1, 1), Attractor("rotation", 1, -1)
DOUBLED = Attractor("oscillation", 2)
COEXISTING = (
    (REST, FORWARD, BACKWARD, DOUBLED, "undecided", "failed"),
    (REST, FORWARD, BACKWARD, *(Attractor("oscillation", 1, lean=side) for side in (1, -1))),
    (DOUBLED, FORWARD, BACKWARD, Attractor("rotation", 2, 2), Attractor("rotation", 2, -2)),
    (REST, Attractor("inverted_rest", 1), FORWARD, BACKWARD, TUMBLING, "undecided"),
    (*(Attractor("rotating_chaos", w=w) for w in (1, -1)), TUMBLING, DOUBLED, "failed"),
    (*(Attractor("oscillation", 4, lean=side) for side in (1, -1)), FORWARD, BACKWARD, "undecided"),
    (REST, *(Attractor("oscillation", n) for n in (1, 2, 3)), TUMBLING),
)


def shade(one: Attractor | str) -> str:
    cells = {"undecided": palette.UNDECIDED, "failed": palette.FAILED}
    return cells[one] if isinstance(one, str) else palette.colour(one)


def perceived(one: Attractor | str, deficiency: str) -> npt.NDArray[np.float64]:
    """Return the perceived colour in Ottosson's OKLab, times 100."""
    channel = np.array(palette.parts(shade(one))) / 255
    linear = np.where(channel <= 0.04045, channel / 12.92, ((channel + 0.055) / 1.055) ** 2.4)
    seen = np.clip(DEFICIENCIES[deficiency] @ linear, 0, 1)
    to_cones = np.array(
        [
            [0.4122214708, 0.5363325363, 0.0514459929],
            [0.2119034982, 0.6806995451, 0.1073969566],
            [0.0883024619, 0.2817188376, 0.6299787005],
        ]
    )
    to_lab = np.array(
        [
            [0.2104542553, 0.7936177850, -0.0040720468],
            [1.9779984951, -2.4285922050, 0.4505937099],
            [0.0259040371, 0.7827717662, -0.8086757660],
        ]
    )
    lab: npt.NDArray[np.float64] = 100 * to_lab @ np.cbrt(to_cones @ seen)
    return lab


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
@pytest.mark.parametrize("every", COEXISTING)
def test_colours_that_coexist_are_distinguishable(
    every: tuple[Attractor | str, ...], deficiency: str
) -> None:
    for one, other in itertools.combinations(every, 2):
        gap = np.linalg.norm(perceived(one, deficiency) - perceived(other, deficiency))
        assert gap > 5.0, (one, other, gap)


def test_colours_have_names() -> None:
    assert palette.colour(REST) == "#474747"
    for one in itertools.chain(*COEXISTING):
        assert palette.in_words(shade(one)).replace(" ", "").isalpha()


@pytest.mark.parametrize("name", ["RdBu_r", "cividis", "magma", "viridis"])
def test_colours_of_recordings_are_those_of_figures(name: str) -> None:
    at = np.linspace(0.0, 1.0, 256)
    drawn = 255 * mpl.colormaps[name](at)[:, :3]
    assert np.abs(palette.shades(name, at) - drawn).max() < 16


@pytest.mark.parametrize(
    ("kind", "turns", "lean"), [("oscillation", 0, 0), ("oscillation", 0, 1), ("rotation", -1, 0)]
)
def test_colours_of_all_periods_differ(kind: str, turns: int, lean: int) -> None:
    every = [Attractor(kind, n, turns * n, lean) for n in range(1, 33)]
    assert len({palette.colour(one) for one in every}) == len(every)
    for one, other in itertools.combinations(every, 2):
        gap = float(np.linalg.norm(perceived(one, "none") - perceived(other, "none")))
        assert gap > 1.0 or palette.lap(one) != palette.lap(other), (one, other, gap)


def test_a_repeated_colour_is_darker_or_lighter() -> None:
    assert palette.lap(DOUBLED) == palette.lap(Attractor("rotation", 5, 5)) == 0
    late = Attractor("oscillation", 14)
    assert palette.lap(late) == 2
    lightness = [perceived(Attractor("oscillation", n), "none")[0] for n in (8, 2, 14)]
    assert lightness == sorted(lightness)
    assert palette.colour(TUMBLING) != palette.colour(TUMBLING, 1)
