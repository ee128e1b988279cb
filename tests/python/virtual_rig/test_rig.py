"""Experiments of the virtual rig: motion, sensor, effects, names of parameters."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys

import numpy as np
import pytest

import pendmap
from pendmap import InputError
from pendmap.virtual_rig import EFFECTS, Request, make
from rigs import short


def test_a_free_decay_rests_where_dry_friction_holds_it() -> None:
    experiment = make(Request("free_decay", seed=2, noise=0.0, counts=0))
    (run,) = experiment.runs
    assert abs(run.plan.theta) > 2.9
    parameters = experiment.parameters
    last = run.path.events[-1]
    assert last.what == "stick"
    assert abs(math.sin(last.theta)) <= parameters.friction / parameters.w0**2
    resting = run.angle[run.time > last.time]
    assert run.time[-1] - last.time > 3
    assert np.ptp(resting) == 0.0
    # Each half swing is shorter than the last: eq. 2.6 for large angles.
    peaks = np.abs([event.theta for event in run.path.events])
    assert (np.diff(peaks) < 0).all()


def test_rotations_and_oscillations_are_both_among_forced_runs() -> None:
    turns = [
        abs(run.angle[-1] - run.angle[0]) / math.tau
        for seed in range(2)
        for run in make(Request("forced", seed=seed, duration=15.0)).runs
    ]
    assert min(turns) < 1
    assert max(turns) > 10


def test_noise_and_counts_are_as_requested() -> None:
    clean = short(counts=0)
    for noise, counts in ((0.3, 0), (0.1, 4096), (0.0, 1024)):
        noisy = short(noise=noise, counts=counts)
        steps = math.tau / counts if counts else 0.0
        expected = math.hypot(math.radians(noise), steps / math.sqrt(12))
        for run, plain in zip(noisy.runs, clean.runs, strict=True):
            assert np.std(run.angle - plain.angle) == pytest.approx(expected, rel=0.1)
            if counts:
                assert run.angle / steps == pytest.approx(np.round(run.angle / steps), abs=1e-8)


def test_coloured_noise_dropouts_outliers_and_jitter_are_as_requested() -> None:
    settings = {"counts": 0, "duration": 60.0, "free": 1, "forced": 0}
    clean = short(**settings).runs[0]
    red = short(**settings, noise=0.2, correlation=0.7).runs[0].angle - clean.angle
    assert np.std(red) == pytest.approx(math.radians(0.2), rel=0.1)
    assert np.corrcoef(red[:-1], red[1:])[0, 1] == pytest.approx(0.7, abs=0.05)
    lossy = short(**settings, dropouts=0.1).runs[0]
    assert lossy.lost / 6001 == pytest.approx(0.1, abs=0.04)
    assert lossy.time.size == 6001 - lossy.lost
    far = short(**settings, outliers=0.02).runs[0].angle - clean.angle
    assert np.mean(np.abs(far) > 0.1) == pytest.approx(0.02, abs=0.008)
    assert np.max(np.abs(far[np.abs(far) <= 0.1])) < 1e-9
    shaken = short(**settings, jitter=0.002).runs[0]
    speed = clean.path.velocity(clean.time)
    error = (shaken.angle - clean.angle)[np.abs(speed) > 1] / speed[np.abs(speed) > 1]
    assert np.std(error) == pytest.approx(0.002, rel=0.15)


@pytest.mark.parametrize("name", list(EFFECTS))
def test_each_effect_changes_the_record(name: str) -> None:
    given = {"free": 4, "forced": 3, "duration": 1.0, "counts": 0, "seed": 11}
    soon = {"added_mass:late": ",t0=20", "impulses": ",t0=0.3", "impulses:train": ",every=0.2"}
    changed = short(effects=(name + soon.get(name, ""),), **given)
    pairs = zip(changed.runs, short(**given).runs, strict=True)
    squares = np.concatenate([(one.angle - plain.angle) ** 2 for one, plain in pairs])
    assert 1e-7 < math.sqrt(float(np.mean(squares))) < 0.1


def test_size_scales_and_given_parameters_are_used() -> None:
    plain, twice = (short(effects=("quadratic_drag",), size=size) for size in (1.0, 2.0))
    (small,), (large,) = plain.effects, twice.effects
    assert large.q == pytest.approx(2 * small.q)  # type: ignore[attr-defined]
    (typed,) = short(effects=("magnet:dipole,amplitude=0.25,d=0.3",)).effects
    assert dataclasses.asdict(typed) == {"amplitude": 0.25, "d": 0.3}
    assert short(w0=5.0, c_over_m=0.0, friction=0.0).parameters.w0 == 5.0


def test_noise_does_not_change_the_motion() -> None:
    quiet, loud = short(noise=0.0), short(noise=0.5)
    for a, b in zip(quiet.runs, loud.runs, strict=True):
        assert a.plan == b.plan
        assert (a.path.angle(a.time) == b.path.angle(b.time)).all()


def test_seeds_draw_many_effects_and_only_visible_ones() -> None:
    names = {short(seed=seed, effects=("any",), duration=1.0).effects[0].name for seed in range(40)}
    assert len(names) > 15
    for seed in range(20):
        (effect,) = short(seed=seed, effects=("any",), forced=0, duration=1.0).effects
        assert effect.needs != "forced"


def test_parameters_have_the_names_and_units_that_model_files_have() -> None:
    library = {effect.name: effect for effect in pendmap.effects()}
    for name in library.keys() & EFFECTS.keys():
        ours = {f.name: f.metadata["unit"] or "1" for f in dataclasses.fields(EFFECTS[name])}
        assert ours == {p.name: p.unit for p in library[name].parameters}, name


def test_the_rig_shares_no_code_with_what_is_fitted() -> None:
    code = (
        "import sys\n"
        "from pendmap.virtual_rig import Request, make\n"
        "make(Request('forced', duration=1.0, forced=1))\n"
        "heavy = {'pendmap._core', 'pendmap.analysis.basins', 'xarray'} & set(sys.modules)\n"
        "sys.exit(', '.join(heavy) or 0)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("name", EFFECTS)
def test_every_parameter_of_an_effect_has_bounds(name: str) -> None:
    for field in dataclasses.fields(EFFECTS[name]):
        with pytest.raises(InputError, match=rf"{field.name} must be .*, got 1e\+300"):
            make(Request("forced", effects=(f"{name},{field.name}=1e300",)))
