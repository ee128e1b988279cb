"""A hundred kinds of damaged file: identification gives a result or an error of one line."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest

import pendmap
from damages import DAMAGES, one_line, sound
from pendmap.identification import identified_model, identify
from pendmap.identification.report import as_json, as_text, methods_table, table1_table

if TYPE_CHECKING:
    from pathlib import Path

READ = [name for name, damage in DAMAGES.items() if damage.says is not None]
TRUTH = 6.2
"""Natural frequency of the sound record, rad/s."""


@pytest.mark.parametrize("name", READ)
def test_damage_gives_a_result_with_its_warning_or_an_error_of_one_line(
    name: str, tmp_path: Path
) -> None:
    damage = DAMAGES[name]
    path = tmp_path / f"record{damage.suffix}"
    made = damage.make(sound())
    path.write_bytes(made if isinstance(made, bytes) else made.encode())
    experiment = pendmap.read_experiment(path)
    try:
        report = identify(experiment, methods=["trajectory", "combined_repaired"])
        model = identified_model(report)
    except pendmap.InputError as error:
        one_line(str(error))
        return
    for found in report.methods.values():
        assert found.applicable or found.warnings
        for estimate in found.estimates.values():
            assert math.isfinite(estimate.value)
        for warning in found.warnings:
            one_line(warning)
    warned = any(found.warnings for found in report.methods.values()) or report.run.findings
    # A damage without a finding must not change the identified pendulum.
    assert warned or model.w0 == pytest.approx(TRUTH, rel=1e-3), name
    assert as_json(report)["methods"]
    assert list(as_text(report))
    for head, rows in (methods_table(report), table1_table(report)):
        assert all(len(row) == len(head) for row in rows)
