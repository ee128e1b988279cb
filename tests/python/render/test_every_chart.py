"""Every chart is drawn in any size, and each of its parts into Axes, with room for all texts."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib import rc_context

import motions
import pendmap
import synthetic
from decays import decay, record
from drawn import assert_drawn, assert_room, written
from hidden import once
from pendmap import InputError, Pendulum, Rig, virtual_rig
from pendmap.charts import chart as charts
from pendmap.charts import comparison, identification, palette, registry
from pendmap.charts.marks import Line
from pendmap.charts.names import signed
from pendmap.comparison import Comparison, Ensemble, compare
from pendmap.identification import IdentificationReport, identify
from pendmap.paper import pendulum
from pendmap.records import Experiment, Run, read_experiment
from pendmap.render import drawing, style
from pendmap.virtual_rig import RunPlan

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from pendmap.charts.chart import Chart, Sheet

MODEL = Pendulum(p=0.6)
WIDE = {"theta": (-1.6 * math.pi, 1.6 * math.pi), "velocity": (-3.0, 3.0)}


def experiment(count: int, seconds: float = 10.0) -> Experiment:
    """Return ``count`` decays; the third has more friction, the last is held out."""
    runs = []
    for k in range(count):
        made = decay(tr=0.3 if k == 2 else 0.08, release=1.0, until=40.0)
        time, angle = record(made, seconds=seconds, seed=k)
        held = k == count - 1 > 0
        name, trusted = f"run_{k:02d}", np.ones(time.size, bool)
        runs.append(Run(name, f"{name}.csv", "free", time, angle, trusted, hold_out=held))
    return Experiment(Path("lab"), tuple(runs))


def identified(time: Any, theta: Any, **given: Any) -> IdentificationReport:  # noqa: ANN401
    run = Run("run", "run.csv", "free", time, theta, np.ones(time.size, bool), **given)
    return identify(Experiment(Path("run.csv"), (run,)))


def of_peaks(count: int | None) -> IdentificationReport:
    made = decay()
    return identified(made.peak_time[:count], made.peak[:count], peaks_only=True)


def compared(count: int, seconds: float = 10.0) -> Comparison:
    return compare(Rig(w0=6.2, c_over_m=0.0496, Tr=0.08), experiment(count, seconds))


RESULTS: dict[str, Callable[[], Any]] = {
    "one cell": lambda: synthetic.painted(synthetic.USUAL[:1], (1, 1)),
    "twelve": lambda: synthetic.painted(synthetic.USUAL, (60, 60), **synthetic.UNRELIABLE),
    "wide": lambda: synthetic.painted(**WIDE, **synthetic.UNRELIABLE),
    "tall": lambda: synthetic.painted(theta=(-0.3, 0.4), velocity=(-6.0, 6.0)),
    "thin": lambda: synthetic.painted(theta=(0.0, 1e-12), **synthetic.UNRELIABLE),
    "far": lambda: synthetic.painted(theta=(1e6, 1e6 + 1.0), velocity=(-1.0, 1.0)),
    "huge": lambda: synthetic.painted(theta=(1e300, 2e300)),
    "two chaotic": lambda: synthetic.painted(synthetic.USUAL[10:12]),
    "chaos": lambda: motions.chaotic(cells=16, periods=3),
    "trajectory": lambda: motions.swing(periods=8, steps=20),
    "sweep": lambda: pendmap.sweep(MODEL, {"p": [0.5, 0.6]}, grid=12),
    "map": lambda: pendmap.parameter_map(
        Pendulum(), {"p": (0.3, 1.8, 5), "omega": (1.6, 2.4, 5)}, curves=True, starts=4
    ),
    "bifurcation": lambda: pendmap.bifurcation(Pendulum(), {"p": (0.5, 1.0, 8)}, starts=4),
    "orbit": lambda: pendmap.orbit(MODEL, 1, 1),
    "lyapunov": lambda: pendmap.lyapunov(MODEL),
    "lifetime": lambda: pendmap.lifetime(Pendulum(p=1.7), starts=200),
    "tongues": lambda: pendmap.tongues(Pendulum(), np.linspace(0.5, 3.0, 20)),
    "melnikov": lambda: pendmap.melnikov(Pendulum()),
    "backbone": lambda: pendmap.backbone(Pendulum(), count=5),
    "record": lambda: experiment(1),
    "records": lambda: experiment(3),
    "whole": lambda: identified(*record(decay(), offset=math.radians(0.05), counts=4096)),
    "ends above 12 degrees": lambda: identified(*record(decay(), seconds=15.0)),
    "still": lambda: identified(np.arange(300) / 100, 1e-3 * np.sin(np.arange(300)) ** 3),
    "peaks": lambda: of_peaks(None),
    "two peaks": lambda: of_peaks(2),
    "comparison": lambda: compared(3),
    "too short": lambda: compared(1, seconds=0.4),
    "diagnosis": lambda: once("quadratic_drag"),
}
"""A result of each kind, and those that need most room, or have least to show."""
NOT_BY_PARTS = ("one cell", "wide", "tall", "far", "huge", "whole", "still", "peaks", "two peaks")


@pytest.mark.parametrize("name", RESULTS)
def test_every_chart_is_drawn_in_any_size_and_by_its_parts(name: str) -> None:
    result = RESULTS[name]()
    assert_drawn(result, parts=name not in NOT_BY_PARTS)
    # Curves have names and colours of their own in a recording.
    chart = registry.of_result(result)
    for panel in getattr(chart, "recorded", ()) or chart.panels:
        lines = [one for one in panel.marks if isinstance(one, Line) and one.path]
        known = {one.name: one.colour for one in panel.marks if one.name}
        assert len(lines) < 2 or {one.colour for one in lines} <= set(known.values()), panel.name
        words = [palette.in_words(known[name]) for name in {one.name for one in lines} - {""}]
        assert words.count("grey") < 2, (panel.name, known)


def drawn(chart: Chart | Sheet, **size: Any) -> Figure:  # noqa: ANN401 (as draw takes it)
    with rc_context(style.RC):
        figure = drawing.draw(chart, dpi=100.0, **size)
        figure.draw_without_rendering()
    assert_room(figure)
    return figure


def test_an_identification_is_drawn_in_any_size_and_by_each_part() -> None:
    report = identified(*record(decay(), seconds=15.0))
    for size in ((4.0, 4.0), (16.0, 12.0)):
        assert tuple(drawn(identification.whole(report), size=size).get_size_inches()) == size
    for part in identification.PARTS:
        drawn(identification.whole(report, parts=(part,), title="Figure", subtitle=""))
    with pytest.raises(InputError, match="must be among record, decrement"):
        identification.whole(report, parts=("decays",))
    for shape in (None, (9.0, 5.6), (5.6, 8.0)):
        drawn(pendulum.chart(), size=shape)


def test_a_comparison_of_many_runs_fits_a_screen() -> None:
    figure = drawn(comparison.sheet(compared(5)))
    wide, high = figure.get_size_inches()
    assert 3 < high < 0.75 * wide
    # All are in one panel; the held-out run and that of largest misfit have a row.
    points = sum(np.size(line.get_xdata()) for line in figure.axes[0].get_lines()[1:])
    assert points == 5
    text = written(figure)
    assert "run_04, held out: rms" in text
    assert "run_02: rms" in text
    assert "run_00: rms" not in text
    assert "Fewer than three peaks" in written(drawn(comparison.sheet(compared(1, seconds=0.4))))


@pytest.mark.parametrize("seconds", [20.0, 65.0])
def test_forced_runs_have_rows_in_which_nothing_overlaps(seconds: float, tmp_path: Path) -> None:
    """One run tumbles, and one settles within 70 s."""
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
    text = written(drawn(comparison.sheet(found)))
    drawn(comparison.steady(found.forced, "Steady", "rig"))
    drawn(comparison.tumbling(found.forced, "Tumbling", "rig"))
    assert "escapes from a well" in text
    assert ("oscillation 2:0" in text) == (seconds > 60)


@pytest.mark.parametrize("scale", [1e-9, 1e6])
@pytest.mark.parametrize("spread", [1.0, 1e3, 1e7])
def test_labels_over_many_powers_of_ten_have_room(scale: float, spread: float) -> None:
    near = scale * np.sin(np.arange(50.0))
    up, lines = signed([near, -near * spread], "error")
    panel = charts.Panel("error", "", charts.Axis("x", (0.0, 1.0)), up, lines)
    figure = drawn(charts.Chart("Errors", "", [[panel]], size=(4.0, 2.5)))
    assert len([t for t in figure.axes[0].get_yticklabels() if t.get_text()]) >= 3
