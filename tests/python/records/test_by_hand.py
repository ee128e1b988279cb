"""Columns, units, clock and span given by hand; records in memory; runs as a collection."""

from __future__ import annotations

import json
import re
import shlex
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

import pendmap
from recorded import clean, experiment, found, motion, text, words

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run as Command

TIME, THETA = clean(duration=12.0)
RATE = motion(duration=12.0)[2]
OTHER = np.random.default_rng(3).normal(size=TIME.size)
COUNTS = np.round(THETA * 400 / (2 * np.pi))
X, Y = 0.4 * np.sin(THETA), -0.4 * np.cos(THETA)
FILES = {
    "plain": (text((TIME, THETA)), {}),
    "unlike": (text((OTHER, TIME, np.degrees(THETA)), "a,b,c"), {"time": "b", "angle": 3}),
    "nameless": (text((OTHER, TIME, THETA), ""), {}),
    "nameless whole numbers": (
        text((OTHER, 0 * TIME, 1e3 * TIME, np.arange(TIME.size), THETA), ""),
        {},
    ),
    "nameless beside millis": (text((TIME, 1e3 * TIME, OTHER, THETA), ""), {}),
    "alike": (text((OTHER, TIME, THETA), "v,t,v"), {"time": 2, "angle": 3}),
    "counts": (text((1e3 * TIME, COUNTS), "clk,enc"), {"time": 1, "time_unit": "ms", "angle": 2}),
    "volts": (text((TIME, 0.5 * THETA), "t,out [V]"), {"angle": "out", "angle_scale": 2}),
    "gyroscope": (text((TIME, THETA, np.degrees(RATE)), "t,theta,w"), {"velocity": "w"}),
    "circle": (text((TIME, X, Y, OTHER), "t,u,v,theta"), {"x": "u", "y": "v"}),
    "rated": (text((THETA, OTHER), "p,q"), {"angle": "p", "rate_hz": 100}),
    "worn clock": (text((OTHER, THETA), "t_s,theta_rad"), {"rate_hz": 100}),
    "cut": (text((TIME, THETA)), {"from_s": 2.0, "to_s": 9.0}),
    "recognised": (text((1e3 * TIME, np.degrees(THETA)), "Time,Angle"), {}),
}
UNITS = {
    "unlike": {"angle_unit": "deg"},
    "counts": {"angle_unit": "counts", "counts_per_turn": 400},
    "gyroscope": {"angle_unit": "deg"},
}


def same(one: pendmap.Experiment, other: pendmap.Experiment) -> None:
    """Check that two experiments are equal but for the findings that a description answers."""
    answered = {"columns-guessed", "no-description"}
    for a, b in zip(one, other, strict=True):
        for name in ("name", "kind", "channels", "segments", "count_rad", "unused", "sha256"):
            assert getattr(a, name) == getattr(b, name), name
        for name in ("time", "theta", "trusted", "velocity"):
            assert np.array_equal(getattr(a, name), getattr(b, name)), name
        texts = [[f.text for f in run.findings if f.what not in answered] for run in (a, b)]
        assert texts[0] == texts[1]
    assert one.known == other.known


@pytest.mark.parametrize("name", FILES)
def test_what_is_given_by_hand_is_read_and_written_as_a_description(
    pendmap_command: Command, tmp_path: Path, name: str
) -> None:
    content, given = FILES[name]
    given = given | UNITS.get(name, {})
    path = tmp_path / "run.csv"
    path.write_text(content, encoding="utf-8")
    by_hand = pendmap.read_experiment(path, **given)
    (run,) = by_hand
    inside = (run.time[0] - 1e-9 <= TIME) & (run.time[-1] + 1e-9 >= TIME)
    np.testing.assert_allclose(run.time, TIME[inside], atol=1e-6)
    np.testing.assert_allclose(run.theta, THETA[inside], atol=1e-2)
    called = pendmap_command("look", "run.csv", *words(given), "--write-experiment", "--json")
    assert called.returncode == 0, called.stderr
    assert json.loads(called.stdout)["channels"] == dict(run.channels)
    same(pendmap.read_experiment(tmp_path), by_hand)
    assert pendmap_command("look", "run.csv", "--write-experiment").returncode == 2
    again = pendmap_command("look", ".", "--write-experiment", "--overwrite")
    assert again.returncode == 0, again.stderr
    same(pendmap.read_experiment(tmp_path), by_hand)


def test_options_override_the_description_of_every_file(tmp_path: Path) -> None:
    described = """rig.encoder_counts = 4096
        columns.angle = { name = "theta_rad", scale = 7.0 }
        run = [{ file = "a.csv", to_s = 3.0 }, { file = "b.csv" }]"""
    content = text((TIME, THETA, np.degrees(THETA)), "t_s,theta_rad,other")
    experiment(tmp_path, described, a=content, b=content)
    given = {"angle": "other", "angle_unit": "deg", "to_s": 8.0, "counts_per_turn": 1000}
    whole = pendmap.read_experiment(tmp_path, **given)
    assert whole.known["encoder_counts"] == 1000
    for run in whole:
        np.testing.assert_allclose(run.theta, THETA[TIME <= 8.0], atol=1e-6)
        assert "from 0 to 8 s are used" in found(run)["cut"].text
    (tmp_path / "experiment.toml").unlink()
    (tmp_path / "notes.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    assert [run.name for run in pendmap.read_experiment(tmp_path, **given)] == ["a", "b"]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"angle": "thet"}, r"angle must be one of 1 't', 2 'theta', got 'thet', perhaps 'theta'"),
        ({"time": 3}, "time must be one of 1 't', 2 'theta', got 3"),
        ({"angle": 0}, "must be a whole number from 1 to 1000, got 0"),
        ({"angle-unit": "ell"}, "'--angle-unit': must be one of rad, .*, got 'ell'"),
        ({"time-unit": "deg"}, "'--time-unit': must be one of s, .*, got 'deg'"),
        ({"angle-unit": "counts"}, "'--angle-unit': must be one of rad, .*, got 'counts'"),
        ({"angle-scale": 0}, "'--angle-scale': must be any number but 0, got 0"),
        ({"from": 5, "to": 2}, "'--from': must be less than to_s = 2, got 5"),
        ({"from": 50}, "must be times within 0 to 12 s, they leave 0 samples"),
        ({"x": 2}, "both or neither of pixel_x and pixel_y must be given, got one"),
        ({"counts-per-turn": 0}, "'--counts-per-turn': must be a whole number from 1 to .*, got 0"),
    ],
)
def test_an_invalid_value_is_refused_in_one_line(
    pendmap_command: Command, tmp_path: Path, given: dict[str, Any], says: str
) -> None:
    (tmp_path / "run.csv").write_text(text((TIME, THETA), "t,theta"), encoding="utf-8")
    for command in (["look"], ["identify"], ["diagnose"]):
        called = pendmap_command(*command, "run.csv", *words(given))
        assert called.returncode == 2
        assert called.stderr.count("\n") == 1
        assert re.search(says, called.stderr), called.stderr


@pytest.mark.parametrize(
    ("content", "given"),
    [
        (text((OTHER, THETA), "a,b"), {}),
        (text((0 * TIME, THETA), ""), {}),
        (text((np.arange(TIME.size), THETA), "tick,theta_rad"), {}),  # a counter is no clock
        (text((TIME, 0.1 * RATE, 0.2 * RATE, RATE), "t_s,z,y,x"), {}),  # axes are no places
        (text((TIME, 9.81 * THETA, OTHER), "t_s,acc x (m/s2),acc y (m/s2)"), {}),  # no angle
        (text((TIME, 1e6 * THETA), "t_s,theta_rad"), {}),
        (text((0 * TIME, THETA), "t_s,theta_rad"), {}),
        (text((OTHER, THETA), "t_s,theta_rad"), {}),
        (text((TIME, np.nan * TIME, THETA), "t_s,theta_rad,spare"), {}),
        (text((1e3 * TIME, THETA), "Time,theta_rad"), {"from_s": 2.0}),
        (text((TIME, RATE, THETA), "t,w,theta"), {"velocity": "w", "from_s": 90.0}),
        (text((TIME, np.degrees(RATE)), "t,w"), {"angle_unit": "deg"}),
    ],
)
def test_a_refused_file_is_read_by_the_line_that_refuses_it(
    pendmap_command: Command, tmp_path: Path, content: str, given: dict[str, Any]
) -> None:
    (tmp_path / "run 1.csv").write_text(content, encoding="utf-8")
    called = pendmap_command("look", "run 1.csv", *words(given))
    assert called.returncode == 2
    line = called.stderr.strip()
    called = pendmap_command(*shlex.split(line[line.index("pendmap look") :])[1:])
    assert called.returncode == 0, (line, called.stderr)


@pytest.mark.parametrize(
    ("columns", "names"),
    [
        ((OTHER, TIME, THETA), "a,b,c"),
        ((np.where(TIME < 0.1, TIME, np.nan), TIME, THETA), ""),  # settings beside the rows
        ((TIME, OTHER, THETA), "t_s,a,b"),
        ((0 * TIME, TIME, np.degrees(THETA)), "angle,t_s,theta_deg"),
    ],
)
def test_columns_whose_names_say_nothing_are_taken_by_their_values(
    tmp_path: Path, columns: tuple[Any, ...], names: str
) -> None:
    (tmp_path / "run.csv").write_text(text(columns, names), encoding="utf-8")
    (run,) = pendmap.read_experiment(tmp_path / "run.csv")
    np.testing.assert_allclose(run.theta, THETA, atol=2e-6)
    assert any(finding.what == "columns-guessed" for finding in run.findings)


def test_without_names_noise_is_no_angle(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(text((TIME, OTHER, -OTHER), ""), "utf-8")
    with pytest.raises(pendmap.InputError, match=r"no column of angles: .* --angle 2$"):
        pendmap.read_experiment(tmp_path / "run.csv")


def test_times_that_look_like_milliseconds_are_not_cut_in_seconds(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(text((1e3 * TIME, THETA), "Time,theta_rad"), "utf-8")
    with pytest.raises(pendmap.InputError, match=r"--time-unit milliseconds$"):
        pendmap.read_experiment(tmp_path / "run.csv", from_s=2.0)
    (run,) = pendmap.read_experiment(tmp_path / "run.csv", from_s=2.0, time_unit="ms")
    assert run.time[0] == pytest.approx(2.0)


DATES = pd.Timestamp("2026-03-01 23:59:55") + pd.to_timedelta(TIME, unit="s")
FRAME = pd.DataFrame({"t_s": TIME, "theta_rad": THETA})
DEGREES = np.degrees(THETA)


@pytest.mark.parametrize(
    ("records", "theta", "given"),
    [
        (TIME, THETA, {}),
        (TIME.tolist(), THETA.tolist(), {}),
        (list(DATES.to_pydatetime()), THETA, {}),
        (DATES, DEGREES, {"angle_unit": "deg"}),
        (FRAME["t_s"][::-1][::-1], pd.Series(DEGREES, name="theta_deg"), {}),
        (pd.Series(1e3 * TIME, name="t_ms"), THETA, {}),
        (FRAME.set_axis(DATES)["theta_rad"], None, {}),
        (pd.Series(THETA, index=pd.Index(TIME, name="t")), None, {}),
        (FRAME.assign(t_s=DATES.tz_localize("UTC")), None, {}),
        (FRAME.assign(t_s=list(DATES.to_pydatetime())).astype({"t_s": object}), None, {}),
        (FRAME.assign(t_s=DATES.astype(str)), None, {}),
        (FRAME.rename(columns={"t_s": "a", "theta_rad": "b"}), None, {"time": 1, "angle": "b"}),
    ],
)
def test_records_may_be_arrays_and_tables(
    records: Any,  # noqa: ANN401 (arrays)
    theta: Any,  # noqa: ANN401 (arrays)
    given: dict[str, Any],
) -> None:
    (run,) = pendmap.read_experiment(records, theta, **given)
    np.testing.assert_allclose(run.time, TIME, atol=1e-6)
    np.testing.assert_allclose(run.theta, THETA, atol=1e-9)


@pytest.mark.parametrize("form", ["dataset", "array", "dates", "degrees", "arrays", "simulated"])
def test_records_may_be_of_xarray(form: str) -> None:
    swing = pendmap.simulate(pendmap.Rig(w0=6.2, c_over_m=0.05), 1.0, 0.0, t_eval=TIME)
    theta = swing.theta
    records: Any = {"dataset": theta.to_dataset(), "simulated": swing}.get(form, theta)
    beside = None
    if form == "dates":
        records = theta.assign_coords(time=DATES.to_numpy())
    elif form == "degrees":
        records = (theta * 180 / np.pi).assign_attrs(units="degrees").rename("angle")
    elif form == "arrays":
        records, beside = 1e3 * swing.time, (theta * 180 / np.pi).assign_attrs(units="deg")
        records.attrs["units"] = "ms"
    (run,) = pendmap.read_experiment(records, beside)
    np.testing.assert_allclose(run.time, TIME, atol=1e-6)
    np.testing.assert_allclose(run.theta, theta, atol=1e-9)


def test_arrays_are_records_of_all_functions() -> None:
    given = {"angle_unit": "deg", "to_s": 8.0}
    report = pendmap.identify(TIME, DEGREES, methods=["trajectory"], **given)
    assert report.run.time.size == 801
    model = report.model
    assert pendmap.compare(model, TIME, DEGREES, **given).runs[0].run.time.size == 801
    with pytest.raises(pendmap.InputError, match="angle_unit must be one of"):
        pendmap.diagnose(TIME, DEGREES, angle_unit="ell")
    for wrong in (FRAME, THETA[1:]):
        with pytest.raises(pendmap.InputError, match="must be of one shape"):
            pendmap.identify(TIME, wrong)
    with pytest.raises(TypeError, match="unexpected keyword argument 'rate'"):
        pendmap.identify(TIME, DEGREES, rate=3)
    with pytest.raises(pendmap.InputError, match="angle must be left out where no file or table"):
        pendmap.identify(report.run, angle=2)


def test_an_experiment_is_a_collection_of_runs(tmp_path: Path) -> None:
    described = 'run = [{ file = "a.csv" }, { file = "b.csv" }]'
    content = text((TIME, THETA))
    whole = experiment(tmp_path, described, a=content, b=text((TIME, 0.5 * THETA)))
    assert [run.name for run in whole] == ["a", "b"]
    assert len(whole) == 2
    assert whole["b"] is whole[1] is whole.runs[-1]
    with pytest.raises(pendmap.InputError, match="run must be one of a, b, got 'c'"):
        whole["c"]
    table = whole.to_dataframe()
    assert table.index.tolist() == ["a", "b"]
    assert table["samples"].tolist() == [TIME.size] * 2
    assert repr(whole) == f"<Experiment {tmp_path.name}: 2 runs, 2 free>"
    assert re.fullmatch("<Run a: free, 1201 samples, 0 to 12 s>", repr(whole["a"]))
    assert "<th>b</th>" in whole._repr_html_()
    assert "<th>theta_rad</th>" in whole["b"]._repr_html_()
    samples = whole["a"].to_dataframe()
    np.testing.assert_array_equal(samples["trusted"], whole["a"].trusted)
    (again,) = pendmap.read_experiment(samples)
    np.testing.assert_array_equal(again.theta, whole["a"].theta)
