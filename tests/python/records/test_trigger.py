"""The trigger: instants of releases."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from pendmap.records.releases import edges_of
from recorded import clean, experiment, found, text
from released import released

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

NAMES = "t_s,theta_rad,sync"


def pulses(time: Floats, at: Floats, width: float = 0.05) -> Floats:
    """Return 1 for a while from each instant on, otherwise 0."""
    after = np.searchsorted(at, time, side="right") - 1
    return np.where((after >= 0) & (time - at[np.maximum(after, 0)] < width), 1.0, 0.0)


def test_edges_between_two_levels_are_found() -> None:
    rng = np.random.default_rng(1)
    level = np.repeat([0.2, 3.4, 0.2, 3.4, 0.2], [50, 3, 100, 40, 30])
    values = level + 0.1 * rng.standard_normal(level.size)
    values[60] = np.nan
    for edge, places in (("rising", [50, 153]), ("falling", [53, 193]), (None, [50, 153])):
        np.testing.assert_array_equal(edges_of(values, edge)[0], places)
    falls, edge = edges_of(np.repeat([1.0, 0.0], [40, 60]))
    assert (falls.tolist(), edge) == ([40], "falling")
    for without in (np.ones(50), rng.standard_normal(2000)):
        assert not edges_of(without)[0].size


@pytest.mark.parametrize("edge", ["rising", "falling"])
@pytest.mark.parametrize("form", ["ttl", "bool", "voltage", "bouncing"])
def test_an_edge_marks_the_release(tmp_path: Path, edge: str, form: str) -> None:
    # The pendulum swings in the hand before; only the trigger distinguishes this from a release.
    made = released((1.2, 2.0), (12.0, 15.0), tremor=0.02)
    held = np.ones(made.time.size, bool)
    for low, high in made.spans:
        held[(made.time >= low) & (made.time <= high)] = False
    high = held if edge == "falling" else ~held
    # Before the first release there is only a hold of 0.1 s.
    column = high.astype(float)
    lead = np.full(10, float(edge == "falling"))
    theta = np.r_[np.full(10, made.theta[0]), made.theta]
    column = np.r_[lead, column]
    starts = [0.1 + low for low, _ in made.spans]
    time = np.arange(theta.size) / 100
    rows = text((time, theta), "t_s,theta_rad").splitlines()
    if form == "bouncing":
        for start in starts:
            k = round(100 * start)
            column[[k + 1, k + 3]] = lead[0]
    if form == "bool":
        words = ["True" if value else "False" for value in column]
    else:
        noise = 0.05 * np.random.default_rng(2).standard_normal(column.size)
        volts = 0.3 + 4.5 * column + noise if form == "voltage" else column
        words = [f"{value:.3f}" for value in volts]
    content = "\n".join([NAMES, *(f"{r},{w}" for r, w in zip(rows[1:], words, strict=True))]) + "\n"
    described = (
        f'[columns]\ntrigger = {{ name = "sync", edge = "{edge}" }}\n[[run]]\nfile = "a.csv"\n'
    )
    there = experiment(tmp_path, described, a=content)
    assert [run.name for run in there.runs] == ["a 1/2", "a 2/2"]
    for run, start, (_, end) in zip(there.runs, starts, made.spans, strict=True):
        used = run.time[run.trusted]
        assert used[0] == pytest.approx(start, abs=1e-9)
        assert used[-1] <= 0.1 + end
    (said,) = (f for f in there.findings if f.what == "trigger-release")
    assert "2 releases" in said.text
    assert ("bounce" in said.text) == (form == "bouncing")


def test_nothing_before_the_edge_is_used(tmp_path: Path) -> None:
    time, theta = clean()
    (run,) = experiment(
        tmp_path,
        '[[run]]\nfile = "a.csv"\n',
        a=text((time, theta, (time > 4.005).astype(float)), NAMES),
    ).runs
    assert run.time[run.trusted][0] == pytest.approx(4.01)
    assert "4.01 s" in found(run)["trigger-release"].text


@pytest.mark.parametrize(
    ("trigger", "says"),
    [
        (lambda t: 0 * t, "of two levels"),
        (lambda t: np.sin(40 * t), "of two levels"),
        (lambda t: pulses(t, np.arange(0.3, 20, 0.5)), "three swings and less"),
        (lambda t: pulses(t, np.sort(np.random.default_rng(1).uniform(0, 20, 30)), 0.02), "three"),
    ],
)
def test_a_trigger_that_marks_no_release_is_reported(
    tmp_path: Path, trigger: object, says: str
) -> None:
    time, theta = clean()
    path = tmp_path / "a.csv"
    path.write_text(text((time, theta, trigger(time)), NAMES), encoding="utf-8")  # type: ignore[operator]
    (run,) = pendmap.read_experiment(path).runs
    assert run.trusted.all()
    assert [f.what for f in run.findings].count("trigger-unlike") == 1
    assert says in found(run)["trigger-unlike"].text
