"""The model that a diagnosis gives out has no damping below 0."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from pendmap import virtual_rig
from pendmap.discrepancy import diagnose
from pendmap.discrepancy.evidence import evidence_of
from pendmap.discrepancy.held import tried
from pendmap.discrepancy.physical import physical, unphysical
from pendmap.discrepancy.refit import Found
from pendmap.discrepancy.trial import fitted
from pendmap.errors import InputError
from pendmap.model import Effect, Rig
from pendmap.records import read_experiment

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.records import Experiment


def recorded(folder: Path, *, forced: int = 0) -> Experiment:
    request = virtual_rig.Request("hidden", seed=5, effects=("none",), free=3, forced=forced)
    where = virtual_rig.places(folder / "lab", replace=True)
    virtual_rig.write(virtual_rig.make(request), where)
    return read_experiment(where.experiment)


def test_a_negative_coefficient_is_0_and_the_rest_fitted_again(tmp_path: Path) -> None:
    evidence = evidence_of(recorded(tmp_path))
    # Far more drag than there is: the viscous damping has to make up for it.
    model = Rig(6.0, c_over_m=0.05, Tr=0.05, effects=(Effect("quadratic_drag", {"q": 0.05}),))
    trial = fitted(evidence, model, ["w0", "c_over_m", "Tr"])
    found = Found(trial, tried(evidence, trial))
    assert set(unphysical(trial.fit)) == {"c_over_m"}
    usable = physical(evidence, found).trial
    assert unphysical(usable.fit) == {}
    assert usable.fit.model.c_over_m == 0
    assert "c_over_m" not in usable.fit.estimates
    # The coefficient alone at 0, as a file would have it, describes nothing.
    left = fitted(evidence, trial.fit.model, ["w0"], start={"w0": trial.fit["w0"]})
    assert trial.chi2 < usable.chi2 < left.chi2


def test_what_is_physical_stays(tmp_path: Path) -> None:
    found = diagnose(recorded(tmp_path), max_effects=1)
    assert found.usable is found.best


def test_a_forced_run_without_its_drive_is_refused(tmp_path: Path) -> None:
    recorded(tmp_path, forced=1)
    toml = tmp_path / "lab" / "experiment.toml"
    text = toml.read_text(encoding="utf-8")
    kept = [line for line in text.splitlines() if not line.startswith("drive")]
    assert len(kept) < len(text.splitlines())
    toml.write_text("\n".join(kept), encoding="utf-8")
    with pytest.raises(InputError, match="is forced, and nothing says what drives it"):
        diagnose(read_experiment(tmp_path / "lab"))
