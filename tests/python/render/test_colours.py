"""Colours: distinguishable with every kind of colour vision, and assigned by name alone."""

from __future__ import annotations

import itertools

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import pytest

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
COEXISTING = (
    ("rest", "rotation 1:+1", "rotation 1:-1", "oscillation 2:0", "undecided", "failed"),
    ("rest", "rotation 1:+1", "rotation 1:-1", "oscillation 1:0 (+)", "oscillation 1:0 (-)"),
    ("oscillation 2:0", "rotation 1:+1", "rotation 1:-1", "rotation 2:+2", "rotation 2:-2"),
    ("rest", "inverted rest", "rotation 1:+1", "rotation 1:-1", "tumbling chaos", "undecided"),
    ("rotating chaos +", "rotating chaos -", "tumbling chaos", "oscillation 2:0", "failed"),
    ("oscillation 4:0 (+)", "oscillation 4:0 (-)", "rotation 1:+1", "rotation 1:-1", "undecided"),
    ("rest", "oscillation 1:0", "oscillation 2:0", "oscillation 3:0", "tumbling chaos"),
)


def perceived(name: str, deficiency: str) -> npt.NDArray[np.float64]:
    """Return the perceived colour in Ottosson's OKLab, times 100."""
    channel = np.array(palette.rgb(name)) / 255
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
@pytest.mark.parametrize("names", COEXISTING, ids=lambda names: names[0])
def test_colours_that_coexist_are_distinguishable(names: tuple[str, ...], deficiency: str) -> None:
    for one, other in itertools.combinations(names, 2):
        gap = np.linalg.norm(perceived(one, deficiency) - perceived(other, deficiency))
        assert gap > 5.0, (one, other, gap)


def test_colours_depend_on_names_alone() -> None:
    assert palette.colour("rest") == "#474747"
    assert palette.colour("rotation 1:\N{MINUS SIGN}1") == palette.colour("rotation 1:-1")
    assert palette.colour("inverted_rest") == palette.colour("inverted rest")
    assert palette.colour("another name", "tumbling_chaos") == palette.colour("tumbling chaos")
    assert palette.colour("rotation 1:+1", "tumbling_chaos") == palette.colour("rotation 1:+1")
    assert palette.colour("no such thing") == palette.UNNAMED
    for name in itertools.chain(*COEXISTING):
        red, green, blue = palette.rgb(name)
        assert f"#{red:02x}{green:02x}{blue:02x}" == palette.colour(name)
        assert palette.in_words(palette.colour(name)).replace(" ", "").isalpha()


@pytest.mark.parametrize("name", ["RdBu_r", "cividis", "magma", "viridis"])
def test_colours_of_recordings_are_those_of_figures(name: str) -> None:
    at = np.linspace(0.0, 1.0, 256)
    drawn = 255 * mpl.colormaps[name](at)[:, :3]
    assert np.abs(palette.shades(name, at) - drawn).max() < 16


@pytest.mark.parametrize("name", ["oscillation {}:0", "oscillation {}:0 (+)", "rotation {0}:-{0}"])
def test_colours_of_all_periods_differ(name: str) -> None:
    names = [name.format(n) for n in range(1, 33)]
    assert len({palette.colour(one) for one in names}) == len(names)
    for one, other in itertools.combinations(names, 2):
        gap = float(np.linalg.norm(perceived(one, "none") - perceived(other, "none")))
        assert gap > 1.0 or palette.lap(one) != palette.lap(other), (one, other, gap)


def test_a_repeated_colour_is_darker_or_lighter() -> None:
    assert palette.lap("oscillation 2:0") == palette.lap("rotation 5:+1") == 0
    assert palette.lap("oscillation 14:0") == 2
    assert palette.in_words(palette.colour("oscillation 14:0")) == "lighter yellow"
    lightness = [perceived(f"oscillation {n}:0", "none")[0] for n in (8, 2, 14)]
    assert lightness == sorted(lightness)
    assert palette.colour("tumbling chaos") != palette.colour("tumbling chaos b")
