"""The model that a diagnosis gives out has no damping below 0."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from pendmap import report, virtual_rig
from pendmap.diagnosis import diagnose
from pendmap.diagnosis.below_zero import below_zero
from pendmap.diagnosis.candidates import candidates
from pendmap.diagnosis.data import evidence_of
from pendmap.diagnosis.fitted_model import fitted
from pendmap.diagnosis.held import Held, tried
from pendmap.diagnosis.physical import physical, unphysical
from pendmap.diagnosis.state import Found
from pendmap.diagnosis.summary import as_json, as_text
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
    # More drag than there is: the viscous damping has to make up for it.
    model = Rig(6.0, c_over_m=0.05, Tr=0.05, effects=(Effect("quadratic_drag", {"q": 0.01}),))
    trial = fitted(evidence, model, ["w0", "c_over_m", "Tr"])
    found = Found(trial, tried(evidence, trial))
    assert set(unphysical(trial.fit)) == {"c_over_m"}
    base = Found(trial, found.held)
    usable = physical(evidence, base, found).trial
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


def test_a_search_from_0_finds_the_effects_that_are_there(tmp_path: Path) -> None:
    # Drag is hidden; a fit with far too much of it needs damping that feeds the motion.
    request = virtual_rig.Request("hidden", seed=5, effects=("quadratic_drag",), free=3, forced=0)
    where = virtual_rig.places(tmp_path / "lab", replace=True)
    virtual_rig.write(virtual_rig.make(request), where)
    evidence = evidence_of(read_experiment(where.experiment))
    base = fitted(evidence, Rig(6.0, c_over_m=0.01, Tr=0.05), ["w0", "c_over_m", "Tr"])
    drag = next(c for c, *_ in candidates((), driven=False) if c.name == "quadratic_drag")
    model = Rig(6.0, Tr=0.05, effects=(Effect("quadratic_drag", {"q": 0.01}),))
    wrong = fitted(evidence, model, ["w0", "c_over_m", "Tr"], [drag])
    assert set(unphysical(wrong.fit)) == {"c_over_m"}
    found = Found(wrong, tried(evidence, wrong))
    usable = physical(evidence, Found(base, tried(evidence, base)), found).trial
    assert unphysical(usable.fit) == {}
    assert usable.names == ("quadratic_drag",)
    assert "c_over_m" not in usable.fit.estimates
    # The rest as it is with the drag that is there and no viscous damping.
    best = fitted(
        evidence,
        Rig(6.0, Tr=0.05, effects=(Effect("quadratic_drag", {"q": 1e-3}),)),
        ["w0", "Tr", "quadratic_drag.q"],
    )
    assert usable.chi2 <= 1.01 * best.chi2
    assert usable.chi2 < wrong.chi2


@pytest.mark.parametrize("rate", [-2e-3, 2e-3])
def test_a_drift_that_takes_friction_below_0_is_told_with_its_time(
    rate: float, tmp_path: Path
) -> None:
    evidence = evidence_of(recorded(tmp_path))
    last = max(run.lab_time_s + run.time[-1] for run in evidence.fitted)
    model = Rig(
        6.0,
        c_over_m=0.05,
        Tr=0.5,
        effects=(
            Effect("viscous_drift", {"r": rate * 0.1 / last}),
            Effect("coulomb_drift", {"r": rate * 1000 / last}),
        ),
    )
    trial = fitted(evidence, model, ["w0", "c_over_m", "Tr"], steps=0)
    told = below_zero(evidence, Found(trial, Held(trial.chi2, 1, trial.fit)), {})
    if rate > 0:
        assert told == {}
    else:
        # Tr + r t = 0; the damping, a thousandth less of itself, does not get there.
        assert set(told) == {"Tr"}
        assert told["Tr"] == pytest.approx(trial.fit["Tr"] / (2 / last), abs=0.02 * last)


def test_what_the_model_file_has_instead_is_said(tmp_path: Path) -> None:
    # A damping that grows with the cube of the velocity, by a model that may only grow with it.
    request = virtual_rig.Request(
        "hidden", seed=5, effects=("cubic_damping",), size=3.0, free=3, forced=0
    )
    where = virtual_rig.places(tmp_path / "lab", replace=True)
    virtual_rig.write(virtual_rig.make(request), where)
    found = diagnose(read_experiment(where.experiment), max_effects=0)
    negative = found.best.trial.fit["Tr"]
    assert negative < 0
    fields = as_json(found)
    assert fields["unphysical"] == {"Tr": negative}
    given = fields["model_file"]
    assert given["rms"] == found.usable.trial.fit.rms > found.best.trial.fit.rms
    assert given["parameters"]["w0"] == found.usable.trial.fit["w0"]
    assert "Tr" not in given["parameters"]
    (line,) = (line for line in as_text(found) if "the model file has 0 there" in line)
    assert f"residual {given['rms']:.4g} rad" in line
    written = report.as_markdown(report.diagnosis(found), {})
    assert "| in the model file |" in written
    assert found.below_zero == {}
