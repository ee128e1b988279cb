"""``diagnose`` on measured records, beside fits by hand of damping, friction, drag and zero."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from pendmap.diagnosis import diagnose
from pendmap.records import read_experiment

if TYPE_CHECKING:
    from pendmap.diagnosis import Discrepancy

RECORDS = os.environ.get("PENDMAP_RECORDS", "")

pytestmark = pytest.mark.skipif(not RECORDS, reason="PENDMAP_RECORDS names no folder of records")

BY_HAND = {
    "galileo_free": 0.00236,
    "cartpend_upright": 0.0086,
    "multiarm_single_free_large": 0.0028,
}
"""Root mean square residual, rad, of the fits by hand to the whole record."""
CARTPEND, HELD = ("upright", "40", "20"), "80"
"""Decays of one pendulum, named by their starts, and the held-out one."""
HELD_BY_HAND = 0.0083
"""Root mean square residual, rad, on the held-out decay of the hand fit to the three others."""


def path_of(name: str) -> Path:
    return next(Path(RECORDS).rglob(f"{name}.csv"))


def check_named(diagnosis: Discrepancy) -> None:
    """Assert that drag is named first, no coefficient is negative, and no warm-up is named."""
    names = [effect.name for effect in diagnosis.effects]
    assert names[0] == "quadratic_drag"
    assert not [name for name in names if name.endswith("warm_up")]
    # The residual is far above the noise: the named effects are incomplete.
    assert diagnosis.verdict == "partial"
    assert all(effect.approximate for effect in diagnosis.effects)
    assert diagnosis.assessment.closed > 0.9


@pytest.mark.parametrize("name", BY_HAND)
def test_the_drag_is_named_first_and_the_residual_is_close_to_that_of_the_hand_fit(
    name: str,
) -> None:
    diagnosis = diagnose(read_experiment(path_of(name)))
    check_named(diagnosis)
    fit = diagnosis.best.fitted.fit
    assert len(fit.windows) == 1
    assert fit.rms <= 1.2 * BY_HAND[name]
    assert diagnosis.gap.held_out_after < 0.3 * diagnosis.gap.held_out_before


@pytest.mark.thorough
def test_decays_of_one_pendulum_predict_the_one_held_out(tmp_path: Path) -> None:
    lines = []
    for name in (*CARTPEND, HELD):
        file = f"cartpend_{name}.csv"
        shutil.copy(path_of(f"cartpend_{name}"), tmp_path)
        lines += ["[[run]]", f'file = "{file}"', f"hold_out = {str(name == HELD).lower()}"]
    (tmp_path / "experiment.toml").write_text("\n".join(lines), encoding="utf-8")
    diagnosis = diagnose(read_experiment(tmp_path))
    check_named(diagnosis)
    (held,) = diagnosis.data.held
    assert held.name == f"cartpend_{HELD}"
    assert diagnosis.gap.held_out_after <= 1.3 * HELD_BY_HAND
