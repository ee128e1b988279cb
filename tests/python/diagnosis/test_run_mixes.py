"""Diagnoses of every mix of free and forced runs, held out or not."""

from __future__ import annotations

import dataclasses

import pytest

import pendmap
from hidden import recorded
from pendmap.diagnosis import diagnose

CHIRP = pendmap.Effect("drive_chirp", {"r": 1e-4})
RIG = pendmap.Rig(w0=6.2, c_over_m=0.05, Tr=0.08, p=0.1, Omega=10.0, effects=(CHIRP,))


@pytest.mark.parametrize(
    ("free", "forced", "hidden", "held"),
    [
        (2, 1, "drive_chirp", ""),
        (1, 1, "drive_second_harmonic", ""),
        (1, 1, "drive_phase", "free"),
        (1, 2, "lateral_drive", "forced"),
        (0, 1, "drive_phase", ""),
        (0, 3, "drive_phase", ""),
        (1, 0, "quadratic_drag", ""),
    ],
)
@pytest.mark.parametrize("model", [None, RIG], ids=["", "given"])
def test_any_mix_of_runs_is_diagnosed(
    free: int, forced: int, hidden: str, held: str, model: pendmap.Rig | None
) -> None:
    experiment, _ = recorded(hidden, seed=5, size=3.0, free=free, forced=forced, duration=8.0)
    runs = (dataclasses.replace(run, hold_out=run.kind == held) for run in experiment.runs)
    experiment = dataclasses.replace(experiment, runs=tuple(runs))
    found = diagnose(experiment, max_effects=1, model=model)
    assert found.data.held
    # A drive that no fitted run has is no candidate; a fitted one is.
    known = {effect.name for effect in pendmap.effects() if effect.group == "drive"}
    ranked = known & {*found.ranking.index}
    assert bool(ranked) is any(run.drive for run in found.data.fitted)
