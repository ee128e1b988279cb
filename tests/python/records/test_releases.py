"""Records of several releases, holds by a hand, triggers; copies among several records."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from decays import decay, record
from pendmap.comparison import compare
from pendmap.comparison.experiment import as_json as compared
from pendmap.identification import identified_model, identify
from pendmap.identification.readings import as_fit_run, reading_of
from pendmap.identification.report import as_json, as_text
from pendmap.records import Experiment, Finding, Run
from recorded import COUNT, TR, W0, C, clean, experiment, found, motion, noisy, read, text

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from conftest import Run as Command

    Floats = NDArray[np.float64]

TRUTH = {"w0": W0, "c_over_m": C, "Tr": TR}
RATE = 100.0


@dataclasses.dataclass(frozen=True)
class Released:
    """Readings, and the first and last time of each free swing."""

    time: Floats
    theta: Floats
    spans: list[tuple[float, float]]


def released(  # noqa: PLR0913 (the releases, and the motion of the hand)
    starts: Sequence[float],
    seconds: Sequence[float],
    *,
    carry: float = 1.0,
    hold: float = 0.8,
    tremor: float = 0.01,
    seed: int = 0,
) -> Released:
    """Return releases from rest, between which a trembling hand carries and holds the pendulum."""
    rng = np.random.default_rng(seed)
    parts: list[Floats] = []
    spans, count = [], 0
    way = (1 - np.cos(np.pi * np.arange(0, 1, 1 / (carry * RATE)))) / 2
    for start, duration in zip(starts, seconds, strict=True):
        if parts:
            last = float(parts[-1][-1])
            hand = np.r_[last + (start - last) * way, np.full(round(hold * RATE), start)]
            # White noise averaged over 0.2 s: at most 5 Hz, zero at both ends of the hold.
            white = rng.standard_normal(hand.size + 40)
            shaking = np.convolve(white, np.ones(20), "same")[: hand.size] / math.sqrt(20)
            fading = np.minimum(1.0, np.arange(hand.size) / 15)
            parts.append(hand + tremor * shaking * fading * fading[::-1])
            count += hand.size
        parts.append(motion(start=start, duration=duration, rate=RATE)[1])
        spans.append((count / RATE, (count + parts[-1].size - 1) / RATE))
        count += parts[-1].size
    return Released(np.arange(count) / RATE, noisy(np.concatenate(parts), seed=seed), spans)


def written(folder: Path, time: Floats, *columns: Floats, names: str = "t_s,theta_rad") -> Path:
    path = folder / "decay.csv"
    path.write_text(text((time, *columns), names), encoding="utf-8")
    return path


def read_releases(folder: Path, made: Released) -> Experiment:
    return pendmap.read_experiment(written(folder, made.time, made.theta))


def several(there: Experiment) -> str:
    (finding,) = (f for f in there.findings if f.what == "several-releases")
    return finding.text


THREE = (1.2, -0.6, 2.4), (20.03, 15.04, 25.02)


@pytest.mark.parametrize(
    ("starts", "seconds", "hand"),
    [
        ((1.2, 2.0), (20.03, 25.02), {}),
        (*THREE, {}),
        ((2.0, -1.0, 0.4, 1.5), (15.3, 12.6, 10.2, 18.0), {"tremor": 0.02}),
        # The amplitude never grows, and no hold lasts for a period.
        ((1.5, 0.3, 0.3), (10.03, 8.02, 9.1), {"tremor": 0.0, "hold": 0.3, "carry": 0.6}),
        ((0.5, 2.0), (12.0, 15.0), {"tremor": 0.0, "hold": 3.0, "carry": 2.0}),
        # The hand passes the middle on its way to a hold of three quarters of a period.
        ((1.19, 0.74, 0.5), (16.06, 10.39, 19.31), {"tremor": 0.0, "hold": 0.74, "carry": 0.69}),
    ],
)
def test_each_release_is_a_run(
    tmp_path: Path, starts: tuple[float, ...], seconds: tuple[float, ...], hand: dict[str, float]
) -> None:
    made = released(starts, seconds, **hand)
    there = read_releases(tmp_path, made)
    count = len(starts)
    assert [run.name for run in there.runs] == [f"decay {k}/{count}" for k in range(1, count + 1)]
    assert f"{count} releases" in several(there)
    for run, (low, high) in zip(there.runs, made.spans, strict=True):
        used = run.time[run.trusted]
        assert low <= used[0] < low + 0.3  # no reading of the hand
        assert high - 1.4 < used[-1] <= high
        at = np.searchsorted(made.time, run.time)
        np.testing.assert_allclose(run.theta, made.theta[at], atol=1e-6)


def test_all_releases_together_give_the_parameters(tmp_path: Path) -> None:
    for seed in range(2):
        there = read_releases(tmp_path, released(*THREE, seed=seed))
        both, longest = (identify(r, methods=["trajectory"]).best for r in (there, there.runs[2]))
        for name, true in TRUTH.items():
            estimate, alone = both.estimates[name], longest.estimates[name].stderr
            assert estimate.stderr is not None
            assert abs(estimate.value - true) < 4 * estimate.stderr < 3 * (alone or 0.0)


def test_every_command_reports_the_releases(tmp_path: Path, pendmap_command: Command) -> None:
    there = read_releases(tmp_path, released((1.2, 2.0), (12.03, 15.02)))
    report = identify(there, methods=["trajectory"])
    names = ["decay 1/2", "decay 2/2"]
    assert sorted(run["name"] for run in as_json(report)["runs"]) == names
    assert all(run["rms"] < 1.2 * run["noise"] for run in as_json(report)["runs"])
    model = identified_model(report)
    assert [record["file"] for record in model.notes["provenance"]["records"]] == ["decay.csv"]
    beside = compare(model, there)
    assert [run["name"] for run in compared(beside)["runs"]] == names
    for lines in (as_text(report), beside.text_parts()[1]):
        assert any("2 releases" in line for line in lines)
    looked = json.loads(pendmap_command("look", "decay.csv", "--json").stdout)
    assert "several-releases" in {finding["what"] for finding in looked["findings"]}
    assert [run["name"] for run in looked["runs"]] == names


def test_each_release_inherits_the_description_of_its_run(tmp_path: Path) -> None:
    made = released(*THREE)
    described = (
        '[[run]]\nfile = "decay.csv"\nlab_time_s = 300\nhold_out = true\n'
        '[[run]]\nfile = "decay.csv"\nto_s = 35\n'
    )
    there = experiment(tmp_path, described, decay=text((made.time, made.theta)))
    parts = [*(f"decay (1) {k}/3" for k in (1, 2, 3)), "decay (2) 1/2", "decay (2) 2/2"]
    assert [run.name for run in there.runs] == parts
    assert [run.hold_out for run in there.runs] == [True] * 3 + [False] * 2
    assert there.runs[4].time[-1] <= 35
    # Drifts refer to the laboratory's clock: a release begins at its time in the file.
    second = there.runs[1]
    given = as_fit_run(second, reading_of(second.time, second.theta))
    assert given.lab_time_s + given.time[0] == pytest.approx(300 + second.time[0])
    assert second.time[0] == pytest.approx(made.spans[1][0], abs=0.3)


def test_a_release_of_few_swings_is_left_out(tmp_path: Path) -> None:
    there = read_releases(tmp_path, released((1.2, 0.8, 2.0), (12.0, 2.2, 15.0)))
    assert [run.name for run in there.runs] == ["decay 1/2", "decay 2/2"]
    assert "3 releases" in several(there)
    assert "1 of fewer than three swings left out" in several(there)
    made = released((0.8, 2.0), (2.2, 15.0))
    (run,) = read_releases(tmp_path, made).runs
    assert run.name == "decay"
    assert run.time[run.trusted][0] >= made.spans[1][0]
    assert "one is used" in found(run)["several-releases"].text


@pytest.mark.parametrize("friction", [0.06, 0.8])
def test_friction_is_not_taken_for_a_hand(tmp_path: Path, friction: float) -> None:
    # Tr is 0.02 of w0^2 at most: the last swings are damped almost by friction alone.
    time, theta = record(decay(release=0.8, c_over_m=0.05, tr=friction, until=80.0), seconds=60)
    rest = np.flatnonzero(np.abs(np.diff(theta[::20])) > 0.01)[-1] / 5
    (run,) = read_releases(tmp_path, Released(time, theta, [])).runs
    assert "several-releases" not in found(run)
    assert run.time[run.trusted][0] == time[0]
    assert run.time[run.trusted][-1] > rest - 1.5


def test_noise_alone_is_refused_in_one_line(tmp_path: Path, pendmap_command: Command) -> None:
    time = np.arange(2000) / 100
    path = written(tmp_path, time, noisy(0 * time, 1e-3, 0))
    (run,) = pendmap.read_experiment(path).runs
    assert not run.trusted.any()
    assert pendmap.noise_floor(run).sigma == pytest.approx(1e-3, rel=0.1)
    for command in ("identify", "diagnose"):
        ran = pendmap_command(command, path)
        assert ran.returncode == 2
        assert ran.stderr.count("\n") == 1
        assert "nothing moves" in ran.stderr


def test_a_still_run_is_left_out_and_its_reason_is_given(tmp_path: Path) -> None:
    time, theta, _ = motion()
    still = [
        Run(name, name, "free", time, 0 * theta, time < 0, findings=(Finding("no-motion", why),))
        for name, why in (("a", "within 1 rad"), ("b", "within 2 rad"))
    ]
    with pytest.raises(pendmap.InputError, match="within 2 rad"):
        Experiment(tmp_path, tuple(still)).refuse_still(still[1:])
    moving = Run("c", "c.csv", "free", time, noisy(theta), np.ones(time.size, bool))
    report = identify(Experiment(tmp_path, (still[0], moving)), methods=["trajectory"])
    assert [run.name for run in report.runs] == ["c"]
    assert "1 run read; not used: 1 at rest" in list(as_text(report))


@pytest.mark.parametrize("angle", [0.3, 1.3, 2.8])
def test_the_end_of_a_hold_is_late_rather_than_early(tmp_path: Path, angle: float) -> None:
    free = motion(start=angle, duration=15.0)[1]
    steps = (0.0, 2 * math.pi / 4096, 2 * math.pi / 1024)
    for seed, (hold, degrees) in enumerate(itertools.product((0.3, 1.5, 20), (0.05, 0.2, 0.5))):
        release = round(100 * hold)
        theta = np.concatenate((np.full(release, angle), free))
        theta = noisy(theta, math.radians(degrees), steps[seed % 3], seed)
        run = read(tmp_path, text((np.arange(theta.size) / 100, theta)))
        assert not run.trusted[:release].any(), (hold, degrees)
        first = int(np.argmax(run.trusted))
        assert run.time[first] - run.time[release] < 0.25, (hold, degrees)
        assert f"used from {run.time[first]:.6g} s" in found(run)["held-start"].text
        if seed == 4:
            fit = identify(run, methods=["trajectory"]).best
            assert fit.misfit == pytest.approx(1.0, abs=0.15)
            assert abs(fit["w0"] - W0) < 4 * (fit.estimates["w0"].stderr or 0.0)


NAMES = "t_s,theta_rad,sync"


@pytest.mark.parametrize("edge", ["rising", "falling"])
@pytest.mark.parametrize("form", ["bool", "voltage", "bouncing"])
def test_an_edge_marks_the_release(tmp_path: Path, edge: str, form: str) -> None:
    # The pendulum swings in the hand before; only the trigger distinguishes this from a release.
    made = released((1.2, 2.0), (12.0, 15.0), tremor=0.02)
    free = np.zeros(made.time.size, bool)
    for low, high in made.spans:
        free[(made.time >= low) & (made.time <= high)] = True
    # Before the first release there is only a hold of 0.1 s.
    theta = np.r_[np.full(10, made.theta[0]), made.theta]
    column = np.r_[np.zeros(10), free] if edge == "rising" else 1.0 - np.r_[np.zeros(10), free]
    starts = [0.1 + low for low, _ in made.spans]
    rows = text((np.arange(theta.size) / 100, theta)).splitlines()[1:]
    if form == "bouncing":
        for start in starts:
            column[[round(100 * start) + 1, round(100 * start) + 3]] = column[0]
    if form == "voltage":
        column = 0.3 + 4.5 * column + 0.05 * np.random.default_rng(2).standard_normal(column.size)
    words = [str(bool(x)) if form == "bool" else f"{x:.3f}" for x in column.tolist()]
    content = "\n".join([NAMES, *(f"{r},{w}" for r, w in zip(rows, words, strict=True))]) + "\n"
    described = (
        f'[columns]\ntrigger = {{ name = "sync", edge = "{edge}" }}\n[[run]]\nfile = "a.csv"\n'
    )
    there = experiment(tmp_path, described, a=content)
    assert [run.name for run in there.runs] == ["a 1/2", "a 2/2"]
    for run, start, (_, end) in zip(there.runs, starts, made.spans, strict=True):
        used = run.time[run.trusted]
        assert used[0] == pytest.approx(start, abs=1e-9)
        assert used[-1] <= 0.1 + end
    (said,) = (f.text for f in there.findings if f.what == "trigger-release")
    assert "2 releases" in said
    assert ("bounce" in said) == (form == "bouncing")


@pytest.mark.parametrize(
    ("trigger", "key", "says"),
    [
        (lambda t: t > 4.005, "trigger-release", "rising edge marks 1 release, at 4.01 s"),
        (lambda t: t < 4.005, "trigger-release", "falling edge marks 1 release, at 4.01 s"),
        (lambda t: 0 * t, "trigger-unlike", "of two levels"),
        (lambda t: np.sin(40 * t), "trigger-unlike", "of two levels"),
        (lambda t: t % 0.5 < 0.05, "trigger-unlike", "three swings and less"),
    ],
)
def test_nothing_before_an_edge_is_used_and_other_columns_mark_no_release(
    tmp_path: Path, trigger: Callable[[Floats], Floats], key: str, says: str
) -> None:
    time, theta = clean()
    path = written(tmp_path, time, theta, 1.0 * trigger(time), names=NAMES)
    (run,) = pendmap.read_experiment(path).runs
    assert says in found(run)[key].text
    if key == "trigger-unlike":
        assert run.trusted.all()
    else:
        assert run.time[run.trusted][0] == pytest.approx(4.01)


def described(*files: str) -> str:
    return "".join(f'[[run]]\nfile = "{name}.csv"\n' for name in files)


def copied(there: Experiment) -> list[str]:
    return [r.name for r in there.runs for f in r.findings if f.what == "same-record"]


def rewritten(time: Floats, theta: Floats, draw: np.random.Generator) -> str:
    """Return a part of a record as text, on another clock, in another unit, with other digits."""
    first = int(draw.integers(0, theta.size // 3))
    part = slice(first, first + int(draw.integers(theta.size // 2, theta.size - first + 1)))
    degrees = bool(draw.integers(0, 2))
    digits = int(draw.integers(3, 7)) - 2 * degrees
    angle = np.round(np.degrees(theta[part]) if degrees else theta[part], digits)
    clock = time[part] + float(draw.uniform(-50, 50))
    return text((clock, angle), "t_s,theta_deg" if degrees else "t_s,theta_rad")


@pytest.mark.parametrize("seed", range(4))
def test_a_copy_is_used_once_in_any_format(seed: int, tmp_path: Path) -> None:
    draw = np.random.default_rng(seed)
    time, theta, _ = motion(float(draw.uniform(0.3, 2.5)), rate=float(draw.choice([50.0, 100.0])))
    count, noise = float(draw.choice([0.0, COUNT])), float(draw.choice([1e-4, 1e-3, 5e-3]))
    reading, other = (noisy(theta, noise, count, seed + more) for more in (0, 100))
    there = experiment(
        tmp_path,
        described("one", "copy", "again"),
        one=text((time, reading)),
        copy=rewritten(time, reading, draw),
        again=text((time, other)),
    )
    assert copied(there) == ["copy"]
    assert [run.moves for run in there.runs] == [True, False, True]


def test_recordings_of_one_decay_are_no_copies(tmp_path: Path) -> None:
    # The last two begin alike, to the count; the third equals a later part of the first.
    files = {}
    for k, start in enumerate((2.0, 1.9, 1.2, 1.2)):
        time, theta, _ = motion(start, duration=30.0, rate=200.0)
        files[f"run_{k}"] = text((time, noisy(theta, 3e-4, COUNT, k)))
    assert copied(experiment(tmp_path, described(*files), **files)) == []


def test_parts_of_a_file_that_overlap_count_once(tmp_path: Path) -> None:
    time, theta, _ = motion()
    both = '[[run]]\nfile = "a.csv"\nto_s = 15.0\n[[run]]\nfile = "a.csv"\nfrom_s = 8.0\n'
    there = experiment(tmp_path, both, a=text((time, noisy(theta))))
    one, other = (set(run.time[run.trusted].tolist()) for run in there.runs)
    assert not one & other
    assert len(copied(there)) == 1


def test_a_copy_held_out_tests_nothing(tmp_path: Path) -> None:
    time, theta, _ = motion(duration=30.0)
    there = experiment(
        tmp_path,
        described("copy") + "hold_out = true\n" + described("one", "two"),
        copy=text((time + 3, np.degrees(noisy(theta))), "t_s,theta_deg"),
        one=text((time, noisy(theta))),
        two=text((time, noisy(motion(0.9, duration=30.0)[1], seed=2))),
    )
    copy = found(there.runs[0])["same-record"]
    assert copy.mended
    assert "copy is a copy of one" in copy.text
    assert "is no independent test" in copy.text
    report = identify(there, methods=["trajectory"])
    assert [run.name for run in report.runs] == ["one", "two"]
    assert any("copies another" in line for line in report.text_parts()[1])
    compared = compare(pendmap.Rig(w0=W0, c_over_m=C, Tr=TR), there)
    assert compared.left_out == (("copy", "it is a copy of another run"),)


def test_runs_of_several_pendulums_are_reported_first(tmp_path: Path) -> None:
    time, theta, _ = motion(duration=30.0)
    files = {
        f"run_{k}": text((scale * time, noisy(theta, seed=k)))
        for k, scale in enumerate((1.0, 1.3, 0.7))
    }
    there = experiment(tmp_path, described(*files), **files)
    assert "rigs-differ" in {finding.what for finding in there.findings}
    with pytest.raises(pendmap.InputError, match="no model can be fitted to these records"):
        identify(there)
    # Periods are those of the small swing.
    swings = {"a": 2.9, "b": 1.0, "c": 0.2}
    files = {k: text((time, noisy(motion(a, duration=30)[1]))) for k, a in swings.items()}
    assert experiment(tmp_path, described(*files), **files).findings == ()
