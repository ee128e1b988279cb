"""``diagnose`` on measured records, in the folder named by the environment.

The reference fits by hand have viscous damping, Coulomb friction, quadratic drag and the sensor's
zero.
"""

from __future__ import annotations

import functools
import os
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from pendmap.diagnosis import diagnose
from pendmap.diagnosis.fitted_model import impose_physics
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
    """Return the path of a record, in the folder or below it."""
    return next(Path(RECORDS).rglob(f"{name}.csv"))


@functools.cache
def found(name: str) -> Discrepancy:
    """Diagnose a record, or the decays of CartPend together."""
    if name != "cartpend":
        return diagnose(read_experiment(path_of(name)))
    with tempfile.TemporaryDirectory() as folder:
        lines = []
        for each in (*CARTPEND, HELD):
            file = f"cartpend_{each}.csv"
            shutil.copy(path_of(f"cartpend_{each}"), folder)
            lines += ["[[run]]", f'file = "{file}"', f"hold_out = {str(each == HELD).lower()}"]
        (Path(folder) / "experiment.toml").write_text("\n".join(lines), encoding="utf-8")
        return diagnose(read_experiment(folder))


def check_named(diagnosis: Discrepancy) -> None:
    """Assert that drag is named first, no coefficient is negative, and no warm-up is named."""
    names = [effect.name for effect in diagnosis.effects]
    assert names[0] == "quadratic_drag"
    assert not [name for name in names if name.endswith("warm_up")]
    estimates = diagnosis.best.fitted.fit.estimates
    for name in ("c_over_m", "Tr", "quadratic_drag.q"):
        assert name not in estimates or estimates[name].value >= 0
    fitted = diagnosis.best.fitted
    assert impose_physics(diagnosis.data, fitted) is fitted
    # The residual is far above the noise: the named effects are incomplete.
    assert diagnosis.verdict == "partial"
    assert all(effect.approximate for effect in diagnosis.effects)
    assert diagnosis.assessment.closed > 0.9


@pytest.mark.parametrize("name", BY_HAND)
def test_the_drag_is_named_first_and_the_residual_is_close_to_that_of_the_hand_fit(
    name: str,
) -> None:
    diagnosis = found(name)
    check_named(diagnosis)
    fit = diagnosis.best.fitted.fit
    # One initial state for the whole record.
    assert len(fit.windows) == 1
    assert fit.rms <= 1.2 * BY_HAND[name]
    assert diagnosis.gap.held_out_after < 0.3 * diagnosis.gap.held_out_before


@pytest.mark.thorough
def test_decays_of_one_pendulum_predict_the_one_held_out() -> None:
    diagnosis = found("cartpend")
    check_named(diagnosis)
    (held,) = diagnosis.data.held
    assert held.name == f"cartpend_{HELD}"
    assert diagnosis.gap.held_out_after <= 1.3 * HELD_BY_HAND
