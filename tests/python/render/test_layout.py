"""Figures at several sizes and windows: ticks, titles, texts."""

from __future__ import annotations

import math

import pytest
import xarray as xr
from matplotlib import rc_context

import motions
import pendmap
import synthetic
from drawn import assert_room, made
from pendmap.charts import basins as layers
from pendmap.charts import plane, registry
from pendmap.render import drawing, style

FLAT = {"theta": (-1.6 * math.pi, 1.6 * math.pi), "velocity": (-3.0, 3.0)}
MAPS = {
    "usual": synthetic.painted(),
    "one": synthetic.painted(synthetic.USUAL[:1], (1, 1)),
    "none": synthetic.painted((), (6, 5)),
    "twelve unreliable": synthetic.painted(synthetic.USUAL, (60, 60), **synthetic.UNRELIABLE),
    "wide": synthetic.painted(theta=(-4 * math.pi, 4 * math.pi), velocity=(-2.0, 2.0)),
    "flat unreliable": synthetic.painted(**FLAT, **synthetic.UNRELIABLE),
    "tall": synthetic.painted(theta=(-0.3, 0.4), velocity=(-6.0, 6.0)),
    "two chaotic": synthetic.painted(synthetic.USUAL[10:12]),
    "trajectory": motions.swing(periods=8, steps=20),
    "friction": pendmap.simulate(pendmap.Pendulum(p=2.2, omega=0.6, theta_r=0.8), 1.0, 0.0, 40.0),
    "torque": synthetic.painted(phase=0.25, torque=-0.5),
}
SHRUNK = {
    "usual": synthetic.painted(),
    "unreliable": synthetic.painted(**synthetic.UNRELIABLE),
    "thin": synthetic.painted(theta=(0.0, 1e-12), velocity=(-1.0, 1.0), **synthetic.UNRELIABLE),
    "far": synthetic.painted(theta=(1e6, 1e6 + 1.0), velocity=(-1.0, 1.0)),
    "huge": synthetic.painted(theta=(1e300, 2e300), velocity=(-1.0, 1.0)),
    "chaos": motions.chaotic(cells=16, periods=3),
}


@pytest.mark.parametrize("name", MAPS)
def test_no_text_is_cut_or_covered(name: str) -> None:
    assert_room(made(MAPS[name]))


@pytest.mark.parametrize("share", [0.3, 0.6])
@pytest.mark.parametrize("name", SHRUNK)
def test_texts_have_room_in_a_smaller_figure(name: str, share: float) -> None:
    with rc_context(style.RC):
        chart = registry.build(SHRUNK[name])
        wide, high = drawing.draw(chart).get_size_inches()
        figure = drawing.draw(chart, size=(share * wide, share * high), dpi=100.0)
        figure.canvas.draw()
    assert_room(figure)


@pytest.mark.parametrize(
    ("low", "high"),
    [
        (0.0, 1e-12),
        (1e300, 2e300),
        (-1e307, 1e307),
        (1e6, 1e6 + 1),
        (1e17, 1e17 + 64),
        (0.0, 1e-322),
        (-3e5, 3e5),
        (-math.pi, math.pi),
    ],
)
def test_there_is_a_handful_of_ticks_whatever_the_window(low: float, high: float) -> None:
    shift, ticks = plane.short_ticks(low, high, angle=True)
    assert 1 <= len(ticks) <= 8
    assert len({label for _, label in ticks}) == len(ticks)
    assert all(len(label) <= 8 for _, label in ticks)
    slack = 1e-6 * (high - low)
    assert all(low - slack <= shift + at <= high + slack for at, _ in ticks)


def test_indistinguishable_copies_are_left_out() -> None:
    circle = xr.Dataset()
    points = synthetic.USUAL[1].points
    assert len(plane.copies(circle, points, -10 * math.pi, 10 * math.pi)) == 10
    assert len(plane.copies(circle, points, 1e300, 2e300)) == 0


def test_the_title_names_no_settling_without_attractors() -> None:
    result = pendmap.basins(pendmap.Pendulum(), pendmap.Grid.square(8), max_periods=1)
    assert layers.text_of(result, layers.LAYERS["turns"].title) == "net turns after 1 period"
    assert result.net_turns.attrs["long_name"] == "net turns after 1 period"
