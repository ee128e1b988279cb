"""The figure of a comparison: no higher than a screen for any number of runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib import rc_context

from decays import decay, record
from drawn import assert_room, written
from pendmap import Rig, virtual_rig
from pendmap.charts import comparison
from pendmap.comparison import Comparison, Ensemble, compare
from pendmap.records import Experiment, Run, read_experiment
from pendmap.render import drawing, style
from pendmap.virtual_rig import RunPlan

MODEL = Rig(w0=6.2, c_over_m=0.0496, Tr=0.08)


def compared(count: int, seconds: float = 10.0) -> Comparison:
    """Compare ``count`` runs; the third has more friction, the last is held out."""
    runs = []
    for k in range(count):
        made = decay(tr=0.3 if k == 2 else 0.08, release=1.0, until=40.0)
        time, angle = record(made, seconds=seconds, seed=k)
        held = k == count - 1 > 0
        name = f"run_{k:02d}"
        trusted = np.ones(time.size, bool)
        runs.append(Run(name, f"{name}.csv", "free", time, angle, trusted, hold_out=held))
    return compare(MODEL, Experiment(Path("lab"), tuple(runs)))


@pytest.mark.parametrize("count", [1, 3, 5])
def test_a_comparison_fits_a_screen_without_overlapping_text(count: int) -> None:
    with rc_context(style.RC):
        figure = drawing.draw(comparison.sheet(compared(count)), dpi=100.0)
        figure.canvas.draw()
    wide, high = figure.get_size_inches()
    assert high < 0.75 * wide
    assert high > 3
    assert_room(figure)
    drawn = written(figure)
    if count > comparison.ALL:  # all in one panel; the held-out run and that of largest misfit
        ratios = figure.axes[0].get_lines()
        points = sum(len(line.get_xdata()) for line in ratios[1:])  # type: ignore[arg-type]
        assert points == count
        assert f"run_{count - 1:02d}, held out: rms" in drawn
        assert "run_02: rms" in drawn
        assert "run_00: rms" not in drawn
    else:
        assert all(f"run_{k:02d}" in drawn for k in range(count))


def test_a_run_without_peaks_is_marked() -> None:
    with rc_context(style.RC):
        figure = drawing.draw(comparison.sheet(compared(1, seconds=0.4)), dpi=50.0)
    assert "Fewer than three peaks" in written(figure)
    assert sum(axes.axison for axes in figure.axes) == 2


@pytest.mark.parametrize("seconds", [20.0, 65.0])
def test_forced_runs_have_rows_in_which_nothing_overlaps(seconds: float, tmp_path: Path) -> None:
    """Figures are drawn of a run that tumbles and of one that settles within 70 s."""
    plans = (
        RunPlan("forced", 1.0, 3.0, seconds, p=1.5, frequency=11.0),
        RunPlan("forced", 0.9, 0.0, seconds, p=0.6, frequency=12.0, phase=0.4),
    )
    request = virtual_rig.Request(
        preset="forced", effects=("none",), w0=6.2, c_over_m=0.3, friction=0.08, plans=plans
    )
    where = virtual_rig.places(tmp_path / "lab", replace=False)
    virtual_rig.write(virtual_rig.make(request), where)
    model = Rig(w0=6.2, c_over_m=0.3, Tr=0.08)
    found = compare(model, read_experiment(where.experiment), ensemble=Ensemble(members=60))
    assert [one.steady is not None for one in found.forced] == [False, seconds > 60]
    with rc_context(style.RC):
        sheets = [
            drawing.draw(comparison.sheet(found), dpi=100.0),
            drawing.draw(comparison.steady(found.forced, "Steady", "rig"), dpi=100.0),
            drawing.draw(comparison.tumbling(found.forced, "Tumbling", "rig"), dpi=100.0),
        ]
        for figure in sheets:
            figure.canvas.draw()
            assert_room(figure)
    drawn = written(sheets[0])
    assert "escapes from a well" in drawn
    assert ("oscillation 2:0" in drawn) == (seconds > 60)
