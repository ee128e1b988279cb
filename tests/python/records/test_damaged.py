"""A hundred kinds of damaged file: each gives a result with a finding, or an error of one line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pendmap
from damages import DAMAGES, DESCRIPTIONS, one_line, sound
from recorded import experiment, found, read, text

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap import Experiment


def consistent(there: Experiment) -> None:
    """Check the properties of every run."""
    for run in there.runs:
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


def read_or_refused(path: Path, content: bytes) -> str:
    """Return the message by which a file is refused; empty if it is read."""
    path.write_bytes(content)
    try:
        consistent(pendmap.read_experiment(path))
    except pendmap.InputError as error:
        one_line(str(error).replace("nan", "").replace("None", ""))
        return str(error)
    return ""


@pytest.mark.parametrize("samples", range(3, 41, 4))
def test_short_records_are_read_or_refused_on_one_line(samples: int, tmp_path: Path) -> None:
    time = np.arange(samples) / 25
    swing = 0.5 * np.cos(6.2 * time)
    false = swing + np.where(np.arange(samples) == samples // 2, 0.7, 0.0)
    for readings in (swing, false, np.zeros(samples), np.minimum(swing, 0.3)):
        read_or_refused(tmp_path / "record.csv", text((time, readings)).encode())


@pytest.mark.parametrize("name", DAMAGES)
def test_damage_gives_a_finding_or_an_error_of_one_line(name: str, tmp_path: Path) -> None:
    damage = DAMAGES[name]
    path = tmp_path / f"record{damage.suffix}"
    made = damage.make(sound())
    content = made if isinstance(made, bytes) else made.encode()
    message = read_or_refused(path, content)
    assert bool(message) == (damage.says is None), message
    if message:
        assert str(path) in message
        assert damage.refused in message
    else:
        there = pendmap.read_experiment(path)
        findings = [*there.findings, *(f for run in there.runs for f in run.findings)]
        assert set(damage.says or ()) <= {finding.what for finding in findings}, findings
    assert path.read_bytes() == content
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", DESCRIPTIONS)
def test_a_damaged_description_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    content, says = DESCRIPTIONS[name]
    with pytest.raises(pendmap.InputError, match=says) as error:
        experiment(tmp_path, content, run=sound())
    one_line(str(error.value))


def test_a_clean_record_has_no_finding(tmp_path: Path) -> None:
    run = read(tmp_path, sound())
    assert set(found(run)) <= {"counts-seen"}
    assert run.trusted.all()


FINITE = st.floats(allow_nan=False, allow_infinity=False)


@settings(max_examples=60, derandomize=True)
@given(values=st.lists(st.tuples(FINITE, FINITE), min_size=5, max_size=60), ordered=st.booleans())
def test_any_numbers_are_read_or_refused(
    tmp_path: Path, values: list[tuple[float, float]], *, ordered: bool
) -> None:
    time = sorted(t for t, _ in values) if ordered else [t for t, _ in values]
    rows = [f"{t!r},{a!r}" for t, (_, a) in zip(time, values, strict=True)]
    read_or_refused(tmp_path / "record.csv", "\n".join(["t_s,theta_rad", *rows]).encode())
