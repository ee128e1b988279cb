"""Figures of all kinds of maps: no text is cut or overlaps anything."""

from __future__ import annotations

import itertools
import math

import pytest
from matplotlib.text import Text

import motions
import pendmap
import synthetic
from drawn import made, overlap, shown

VARIANTS = {
    "usual": synthetic.painted(synthetic.USUAL[:4]),
    "one": synthetic.painted(synthetic.USUAL[:1], (1, 1)),
    "none": synthetic.painted((), (6, 5)),
    "three by two": synthetic.painted(synthetic.USUAL[:2], (3, 2)),
    "twelve": synthetic.painted(synthetic.USUAL, (60, 60), undecided=200, failed=100),
    "twelve unreliable": synthetic.painted(synthetic.USUAL, (60, 60), **synthetic.UNRELIABLE),
    "wide": synthetic.painted(theta=(-4 * math.pi, 4 * math.pi), velocity=(-2.0, 2.0)),
    "wide unreliable": synthetic.painted(
        theta=(-4 * math.pi, 4 * math.pi), velocity=(-2.0, 2.0), **synthetic.UNRELIABLE
    ),
    "flat unreliable": synthetic.painted(
        theta=(-1.6 * math.pi, 1.6 * math.pi), velocity=(-3.0, 3.0), **synthetic.UNRELIABLE
    ),
    "tall": synthetic.painted(theta=(-0.3, 0.4), velocity=(-6.0, 6.0)),
    "two chaotic": synthetic.painted(synthetic.USUAL[10:12]),
    "chaos": motions.chaotic(cells=16, periods=3),
    "trajectory": motions.swing(periods=8, steps=20),
    "friction": pendmap.simulate(pendmap.Pendulum(p=2.2, omega=0.6, theta_r=0.8), 1.0, 0.0, 40.0),
    "torque": synthetic.painted(phase=0.25, torque=-0.5),
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_no_text_is_cut_or_covers_a_panel(variant: str) -> None:
    figure = made(VARIANTS[variant])
    whole = figure.bbox
    panels = [axes.get_window_extent() for axes in figure.axes]
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        box = text.get_window_extent()
        if not text.get_text().strip() or not text.get_visible() or box.width == 0:
            continue
        inside = whole.x0 - 1 <= box.x0 and box.x1 <= whole.x1 + 1
        assert inside, (text.get_text(), box)
        assert whole.y0 - 1 <= box.y0, (text.get_text(), box)
        assert box.y1 <= whole.y1 + 1, (text.get_text(), box)
        if not any(text in axes.texts for axes in figure.axes):  # a warning
            assert not any(overlap(box, panel) for panel in panels), text.get_text()
    others = [text.get_window_extent() for text in figure.findobj(Text) if shown(text)]
    for one, other in itertools.combinations(others, 2):
        assert not overlap(one, other)
