"""The trigger: instants of releases, frequency and phase of a drive."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from pendmap.records.trigger import beat_of, edges_of
from recorded import clean, experiment, found, motion, noisy, text
from released import released

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

NAMES = "t_s,theta_rad,sync"
DRIVE = (0.2, 12.1, 0.3)
OTHER_PHASE = 0.7


def pulses(time: Floats, at: Floats, width: float = 0.05) -> Floats:
    """Return 1 for a while from each instant on, otherwise 0."""
    after = np.searchsorted(at, time, side="right") - 1
    return np.where((after >= 0) & (time - at[np.maximum(after, 0)] < width), 1.0, 0.0)


def driven(phase: float = OTHER_PHASE) -> tuple[Floats, Floats, Floats]:
    """Return a forced run with a pulse whenever Omega t + phi is ``phase``."""
    time, theta, _ = motion(start=0.5, duration=30.0, drive=DRIVE)
    first = (phase - DRIVE[2]) / DRIVE[1]
    edges = first + 2 * math.pi / DRIVE[1] * np.arange(-2, 70)
    return time, noisy(theta), pulses(time, edges)


def forced(folder: Path, trigger: Floats, drive: str, column: str = "") -> pendmap.Run:
    time, theta, _ = driven()
    described = (
        f'[columns]\ntrigger = {{ name = "sync"{column} }}\n'
        f'[[run]]\nfile = "a.csv"\ndrive = {{ p = 0.2, {drive} }}\n'
    )
    (run,) = experiment(folder, described, a=text((time, theta, trigger), NAMES)).runs
    return run


def test_edges_between_two_levels_are_found() -> None:
    rng = np.random.default_rng(1)
    level = np.repeat([0.2, 3.4, 0.2, 3.4, 0.2], [50, 3, 100, 40, 30])
    values = level + 0.1 * rng.standard_normal(level.size)
    values[60] = np.nan
    for edge, places in (("rising", [50, 153]), ("falling", [53, 193]), (None, [50, 153])):
        edges = edges_of(values, edge)
        assert edges is not None
        np.testing.assert_array_equal(edges[0], places)
    falls = edges_of(np.repeat([1.0, 0.0], [40, 60]))
    assert falls is not None
    assert (falls[0].tolist(), falls[1]) == ([40], "falling")
    assert edges_of(np.ones(50)) is None
    assert edges_of(rng.standard_normal(2000)) is None


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
        (lambda t: 0 * t, "not have two levels"),
        (lambda t: np.sin(40 * t), "not have two levels"),
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


def test_a_drive_s_frequency_lies_within_its_error() -> None:
    rng = np.random.default_rng(3)
    misses = []
    for _ in range(300):
        # Periods near whole numbers of samples are included: their edges repeat the same error.
        period = rng.choice([0.5, 0.52]) + rng.choice([0, 1e-5, 1e-4, 3e-3]) * rng.uniform(-1, 1)
        time = np.arange(3000) / 100
        trigger = pulses(time, rng.uniform(0, period) + period * np.arange(80), 0.1)
        edges = edges_of(trigger)
        assert edges is not None
        beat = beat_of(time, edges[0])
        assert beat is not None
        misses.append((beat.omega - 2 * math.pi / period) / beat.stderr)
    assert (
        np.max(np.abs(misses)) < 1.8
    )  # bounds of a uniform distribution are sqrt(3) from its middle
    assert 0.3 < np.std(misses) < 1.2


def test_a_drive_is_compared_with_its_trigger(tmp_path: Path) -> None:
    _, _, trigger = driven()
    said = found(forced(tmp_path, trigger, "Omega = 12.1, phi = 0.3"))
    assert {"trigger-drive"} == {key for key in said if key.startswith("trigger")}
    omega, error = (
        float(x) for x in said["trigger-drive"].text.split(" = ")[1].split(" rad")[0].split(" +- ")
    )
    assert abs(omega - 12.1) < 3 * error < 0.05
    said = found(forced(tmp_path, trigger, "Omega = 12.4, phi = 0.3", ", phase = 0.7"))
    assert "12.4" in said["trigger-differs"].text
    assert "trigger-drive" not in said


@pytest.mark.parametrize(
    ("drive", "column", "phi", "key"),
    [
        ("Omega = 12.1", ", phase = 0.7", DRIVE[2], "trigger-phase"),
        ("Omega = 12.1", "", None, "trigger-drive"),
        ("Omega = 12.1, phi = 0.3", ", phase = 0.7", 0.3, "trigger-drive"),
        ("Omega = 12.1, phi = 1.5", ", phase = 0.7", 1.5, "trigger-differs"),
    ],
)
def test_a_stated_phase_is_used(
    tmp_path: Path, drive: str, column: str, phi: float | None, key: str
) -> None:
    _, _, trigger = driven()
    run = forced(tmp_path, trigger, drive, column)
    assert run.drive is not None
    within = 0.1 if key == "trigger-phase" else 0.0
    assert run.drive["phi"] == (phi if phi is None else pytest.approx(phi, abs=within))
    assert key in found(run)
    assert ("trigger-differs" in found(run)) == (key == "trigger-differs")


def test_bounces_and_lost_edges_do_not_matter(tmp_path: Path) -> None:
    time, _, trigger = driven()
    rises = np.flatnonzero(np.diff(trigger) > 0) + 1
    trigger[rises[::4] + 1] = 0.0
    for k in rises[[5, 17, 18]]:
        trigger[k : k + 8] = 0.0
    said = found(forced(tmp_path, trigger, "Omega = 12.1"))["trigger-drive"].text
    assert "bounces left out" in said
    for odd in (
        0 * time,
        (time > 5.0).astype(float),
        np.random.default_rng(2).integers(0, 2, time.size),
    ):
        keys = [f.what for f in forced(tmp_path, odd * 1.0, "Omega = 12.1").findings]
        assert [key for key in keys if key.startswith("trigger")] == ["trigger-unlike"]
