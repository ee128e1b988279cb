"""The figure of a comparison: no higher than a screen, whatever the number of runs."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.text import Text

from decays import decay, record
from drawn import written
from pendmap import Rig
from pendmap.figures import comparison, style
from pendmap.identification import Comparison, compare
from pendmap.records import Experiment, Run
from test_figure_overlap import overlap, shown

MODEL = Rig(w0=6.2, c_over_m=0.0496, Tr=0.08)


def compared(count: int, seconds: float = 10.0) -> Comparison:
    """``count`` runs; the third has more friction, the last is held out."""
    runs = []
    for k in range(count):
        made = decay(tr=0.3 if k == 2 else 0.08, release=1.0, until=40.0)
        time, angle = record(made, seconds=seconds, seed=k)
        held = k == count - 1 > 0
        name = f"run_{k:02d}"
        trusted = np.ones(time.size, bool)
        runs.append(Run(name, f"{name}.csv", "free", time, angle, trusted, hold_out=held))
    return compare(MODEL, Experiment(Path("lab"), tuple(runs)))


@pytest.mark.parametrize("count", [1, 2, 3, 4, 9])
def test_it_fits_a_screen_and_no_text_covers_another(count: int) -> None:
    with rc_context(style.RC):
        figure = comparison.figure(compared(count), dpi=100.0)
        figure.canvas.draw()
    wide, high = figure.get_size_inches()
    assert high < 0.75 * wide
    assert high > 3
    texts = [text.get_window_extent() for text in figure.findobj(Text) if shown(text)]
    for one, other in itertools.combinations(texts, 2):
        assert not overlap(one, other)
    for box in texts:
        assert box.y0 > -1
        assert box.y1 < figure.bbox.y1 + 1
    drawn = written(figure)
    if count > comparison.ALL:  # all in one panel; the one held out and the one missed most
        ratios = figure.axes[0].get_lines()
        points = sum(len(line.get_xdata()) for line in ratios[1:])  # type: ignore[arg-type]
        assert points == count
        assert f"run_{count - 1:02d}, held out: rms" in drawn
        assert "run_02: rms" in drawn
        assert "run_00: rms" not in drawn
    else:
        assert all(f"run_{k:02d}" in drawn for k in range(count))


def test_a_run_without_peaks_says_so() -> None:
    with rc_context(style.RC):
        figure = comparison.figure(compared(1, seconds=0.4), dpi=50.0)
    assert "Fewer than three peaks" in written(figure)
    assert len(figure.axes) == 2
