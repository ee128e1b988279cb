"""A hundred kinds of damaged file: each gives a result with a finding, or an error of one line."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pendmap
from damages import DAMAGES, DESCRIPTIONS, one_line, sound
from recorded import text

if TYPE_CHECKING:
    from pathlib import Path


def consistent(run: pendmap.Run) -> None:
    """Check the properties of every run."""
    assert run.time.shape == run.theta.shape == run.trusted.shape
    assert run.time.dtype == run.theta.dtype == np.float64
    assert run.time.size >= 3
    assert np.all(np.isfinite(run.time))
    assert np.all(np.isfinite(run.theta))
    assert np.all(np.diff(run.time) > 0)
    for values in (run.velocity, *(run.pivot or {}).values()):
        assert values is None or values.shape == run.time.shape
    for finding in run.findings:
        one_line(finding.text)
    pendmap.noise_floor(run)


@pytest.mark.parametrize("samples", range(3, 41, 4))
def test_short_records_are_read_or_refused_on_one_line(samples: int, tmp_path: Path) -> None:
    time = np.arange(samples) / 25
    swing = 0.5 * np.cos(6.2 * time)
    false = swing + np.where(np.arange(samples) == samples // 2, 0.7, 0.0)
    path = tmp_path / "record.csv"
    for readings in (swing, false, np.zeros(samples), np.minimum(swing, 0.3)):
        path.write_text(text((time, readings)), encoding="utf-8")
        try:
            (run,) = pendmap.read_experiment(path).runs
        except pendmap.InputError as error:
            one_line(str(error))
        else:
            consistent(run)


def test_there_are_a_hundred_kinds() -> None:
    assert len(DAMAGES) + len(DESCRIPTIONS) >= 100


@pytest.mark.parametrize("name", DAMAGES)
def test_damage_gives_a_finding_or_an_error_of_one_line(name: str, tmp_path: Path) -> None:
    damage = DAMAGES[name]
    path = tmp_path / f"record{damage.suffix}"
    made = damage.make(sound())
    path.write_bytes(made if isinstance(made, bytes) else made.encode())
    before = path.read_bytes(), path.stat().st_mtime_ns
    try:
        there = pendmap.read_experiment(path)
    except pendmap.InputError as error:
        message = str(error)
        if damage.says is not None:
            pytest.fail(message)
    else:
        message = ""
    if message:
        one_line(message)
        assert str(path) in message
        assert damage.refused in message
    else:
        for run in there.runs:
            consistent(run)
        findings = [*there.findings, *(f for run in there.runs for f in run.findings)]
        keys = {finding.what for finding in findings}
        assert damage.says is not None, f"{name}: was read, with {keys}"
        assert set(damage.says) <= keys, f"{name}: {[f.text for f in findings]}"
    assert (path.read_bytes(), path.stat().st_mtime_ns) == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", DESCRIPTIONS)
def test_a_damaged_description_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    content, says = DESCRIPTIONS[name]
    (tmp_path / "run.csv").write_text(sound(), encoding="utf-8")
    (tmp_path / "experiment.toml").write_bytes(content.encode())
    with pytest.raises(pendmap.InputError, match=says) as error:
        pendmap.read_experiment(tmp_path)
    one_line(str(error.value))


def test_a_clean_record_has_no_finding(tmp_path: Path) -> None:
    path = tmp_path / "record.csv"
    path.write_text(sound(), encoding="utf-8")
    (run,) = pendmap.read_experiment(path).runs
    assert {finding.what for finding in run.findings} <= {"counts-seen"}
    assert run.trusted.all()


QUIET = settings(max_examples=60, derandomize=True)


def fuzz(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    try:
        runs = pendmap.read_experiment(path).runs
    except pendmap.InputError as error:
        one_line(str(error).replace("nan", "").replace("None", ""))
    else:
        for run in runs:
            consistent(run)


@QUIET
@given(
    values=st.lists(
        st.tuples(
            st.floats(allow_nan=False, allow_infinity=False),
            st.floats(allow_nan=False, allow_infinity=False),
        ),
        min_size=5,
        max_size=60,
    ),
    ordered=st.booleans(),
)
def test_any_numbers_are_read_or_refused(
    tmp_path: Path, values: list[tuple[float, float]], *, ordered: bool
) -> None:
    time = sorted(t for t, _ in values) if ordered else [t for t, _ in values]
    rows = (f"{t!r},{a!r}" for t, (_, a) in zip(time, values, strict=True))
    fuzz(tmp_path / "record.csv", "\n".join(itertools.chain(["t_s,theta_rad"], rows)).encode())


@QUIET
@given(
    at=st.lists(st.integers(0, 20_000), min_size=1, max_size=30),
    what=st.lists(st.integers(0, 255), min_size=1, max_size=30),
)
def test_any_bytes_changed_in_a_record_are_read_or_refused(
    tmp_path: Path, at: list[int], what: list[int]
) -> None:
    content = bytearray(sound().encode())
    for place, byte in zip(at, what, strict=False):
        content[place % len(content)] = byte
    fuzz(tmp_path / "record.csv", bytes(content))
