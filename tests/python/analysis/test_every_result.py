"""What holds of the result of every function that computes one, in both units."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import json
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from pendmap import Effect, Formula, Grid, InputError, Pendulum, Rig, RunOptions, render, viewer
from pendmap.analysis.run import Keywords
from pendmap.files import facts

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import xarray as xr

    from pendmap.analysis.result import Schema

DRAG = Effect("quadratic_drag", {"q": 0.02}, ci95={"q": (0.01, 0.03)}, probability=0.9)
OWN = Formula("own_pull", "-k*sin(2*theta)", {"k": 2})
BARE = Pendulum(gamma=0.1, p=0.6, omega=2.0, effects=(DRAG, OWN(k=0.01)))
SI = Rig(w0=6.2, c_over_m=0.7, p=0.6, Omega=12.1, effects=(DRAG,))
MODELS = pytest.mark.parametrize("model", [BARE, SI], ids=["bare", "si"])

SMALL: dict[str, Callable[..., xr.Dataset]] = {
    "simulate": lambda model, **more: pendmap.simulate(
        model, 1.0, 0.5 * model.units.w0, 31.0 / model.units.w0, **more
    ),
    "basins": lambda model, **more: pendmap.basins(model, 8, **more),
    "basins_of": lambda model, **more: pendmap.basins_of(
        model, [1.0, 2.0], [0.0, 2.5 * model.units.w0], **more
    ),
    "sweep": lambda model, **more: pendmap.sweep(model, {"p": [0.5, 0.6]}, grid=6, **more),
    "parameter_map": lambda model, **more: pendmap.parameter_map(
        model, {"p": [0.5, 0.6], "omega": [1.9, 2.0]}, starts=3, **more
    ),
    "bifurcation": lambda model, **more: pendmap.bifurcation(
        model, {"p": [0.5, 0.6]}, starts=2, **more
    ),
    "continuation": lambda model, **more: pendmap.continuation(
        model, {"p": (0.5, 1.5)}, 1, 1, longest=2, **more
    ),
    "orbit": lambda model, **more: pendmap.orbit(
        model, 1, 0, Grid.square(12, model.units.w0), **more
    ),
    "lyapunov": lambda model, **more: pendmap.lyapunov(model, **{"max_periods": 200} | more),
    "lifetime": lambda model, **more: pendmap.lifetime(
        model, **{"starts": 100, "max_periods": 200} | more
    ),
    "tongues": lambda model, **more: pendmap.tongues(model, [1.9, 2.0], 4.0, **more),
    "melnikov": lambda model, **more: pendmap.melnikov(model, [1.9, 2.0], **more),
}
FUNCTIONS = [name for _, names, _ in pendmap.ANALYSES.values() for name in names]
RESULTS = {name: SMALL.get(name) or getattr(pendmap, name) for name in FUNCTIONS}
"""Small results of all analyses; of one that is not listed that of a model alone."""
RUNS = [name for name in RESULTS if "run" in inspect.signature(getattr(pendmap, name)).parameters]
OF_ALL = ("Conventions", "comment", "history", "source", "references")


def schema_of(name: str) -> Schema:
    """Return the schema of the results of a function."""
    kind = next(kind for kind, (_, names, _) in pendmap.ANALYSES.items() if name in names)
    schema: Schema = importlib.import_module(f"pendmap.analysis.{kind}").SCHEMA
    return schema


@MODELS
@pytest.mark.usefixtures("strict_recordings")
@pytest.mark.parametrize("name", RESULTS)
def test_every_result_is_kept_and_shown(name: str, model: Pendulum | Rig, tmp_path: Path) -> None:
    result = RESULTS[name](model)
    assert pendmap.pendulum_of(result) == model
    for suffix in ("nc", "zarr"):
        back = pendmap.load(pendmap.save(result, tmp_path / f"a.{suffix}"))
        assert back.drop_attrs(deep=False).identical(result.drop_attrs(deep=False))
        assert back.attrs | {"history": ""} == result.attrs | {"history": ""}
        assert pendmap.pendulum_of(back) == model
    assert len(back.pendmap.to_dataframe())
    if name != "basins_of":  # a list of starts has no picture
        assert render.draw(back, tmp_path / "a.svg").stat().st_size > 1000
        assert viewer.record(back, tmp_path / "a.rrd").stat().st_size > 1000
        with pytest.raises(InputError, match="no layer 'nothing'"):
            render.draw(back, tmp_path / "b.svg", layer="nothing")


@pytest.mark.parametrize("name", RESULTS)
def test_every_result_follows_its_schema(name: str) -> None:
    schema = schema_of(name)
    names = [field.name for field in schema.fields]
    assert len(set(names)) == len(names)
    assert all(field.meaning for field in schema.fields)
    result = RESULTS[name](BARE)
    known = set(facts(result)) - set(BARE.attributes) - {"kind", "title", *OF_ALL}
    assert known <= {field.place for field in schema.fields}
    fields = schema.json(result)
    assert list(fields) == [f.name for f in schema.fields if f.json and f.name in fields]
    assert not {f.name for f in schema.fields if not f.json} & set(fields)
    json.dumps(fields)


def test_titles_have_units_and_leave_out_what_is_zero() -> None:
    effects = (
        Effect("stribeck_friction", {"a": 0.5, "vs": 2.0}),
        Effect("power_law_drag", {"q": 0.01, "n": 1.5}),
        Effect("encoder_offset", {"d": -0.01}),
    )
    rig = Rig(w0=2.0, effects=effects, lab_time_s=30)
    for text in ("a = 0.5 rad/s^2, vs = 2 rad/s", "n = 1.5)", "(d = -0.01 rad)", "time = 30 s"):
        assert text in rig.title
    for text in ("stribeck_friction (a = 0.125, vs = 1)", "encoder_offset (d = -0.01 rad)"):
        assert text in rig.pendulum.title  # over w0^2, over w0; an angle is unchanged
    assert Rig(w0=6.2).title == "w0 = 6.2 rad/s, c/m = 0 1/s, p = 0"


POWERS = {"rad/s": 1, "1/s": 1, "s": -1}
"""Powers of w0 by unit in SI."""


@pytest.mark.parametrize("name", RESULTS)
def test_every_result_is_the_same_in_both_units(name: str) -> None:
    rig = Rig(w0=5.0, c_over_m=0.5, p=0.6, Omega=10.0, phi=0.3, effects=(DRAG,))
    there, bare = RESULTS[name](rig), RESULTS[name](rig.pendulum)
    for variable in set(bare.variables) - set(rig.pendulum.attributes):
        unit = there[str(variable).removesuffix("_bounds")].attrs.get("units", "")
        one, other = there[variable].values, bare[variable].values
        if one.dtype.kind == "f":
            factor = 5.0 ** POWERS.get(unit, 0)
            assert one == pytest.approx(factor * other, rel=1e-5, abs=1e-6, nan_ok=True), variable
        else:
            assert np.array_equal(one, other), variable
    assert (bare.attrs["units"], there.attrs["units"]) == ("nondimensional", "SI")


@pytest.mark.parametrize("name", RUNS)
def test_no_result_depends_on_threads(name: str) -> None:
    one, two, eight = (RESULTS[name](BARE, run=RunOptions(threads=n)) for n in (1, 2, 8))
    for other in (two, eight):
        assert one.drop_vars("seconds", errors="ignore").equals(
            other.drop_vars("seconds", errors="ignore")
        )


FITTED = dataclasses.replace(
    SI,
    effects=(),
    notes={
        "covariance": {"names": ["w0", "c_over_m"], "matrix": [[1e-4, 0.0], [0.0, 1e-3]]},
        "provenance": {"rms": 0.0271, "noise": 0.001},
    },
)


@pytest.mark.parametrize("name", RESULTS)
def test_every_result_of_a_fitted_model_reports_its_misfit_and_its_draws(
    name: str, tmp_path: Path
) -> None:
    takes = "draws" in inspect.signature(getattr(pendmap, name)).parameters
    result = RESULTS[name](FITTED, **({"draws": 3} if takes else {}))
    fields = schema_of(name).json(result)
    assert result.attrs["misses_record"] == pytest.approx(27.1)
    assert fields["misses_record"] == pytest.approx(27.1)
    line = "This model misses its record by 27.1 times the noise."
    assert result.attrs["summary"].count(line) == 1
    if takes:
        assert (fields["draws"]["count"], result.drawn.shape) == (3, (3, 2))
        assert fields["draws"]["parameters"] == ["w0", "c_over_m"]
        assert render.draw(result, tmp_path / "a.svg").stat().st_size > 1000
        assert viewer.record(result, tmp_path / "a.rrd").stat().st_size > 1000
        with pytest.raises(InputError, match=r"draws: the model must have a \[covariance\]"):
            RESULTS[name](SI, draws=3)


@pytest.mark.parametrize("name", [name for name in RUNS if name not in {"orbit", "tongues"}])
def test_without_damping_there_are_no_attractors(name: str) -> None:
    result = RESULTS[name](Pendulum(gamma=0.0))
    assert re.search("[Ww]ithout damping.* there are no attractors", result.attrs["summary"])
    assert result.sizes.get("attractor", result.sizes.get("entry", 0)) == 0


REFUSED = {
    "tol": (1.0, "tol must be a number from 1e-13 to 1e-2, got 1"),
    "max_periods": (0, "max_periods must be a whole number from 1 to .*, got 0"),
    "run": ({"seed": 1}, "run must be a RunOptions, like"),
}


def test_options_of_a_run_may_be_given_by_name() -> None:
    assert [*Keywords.__annotations__] == [one.name for one in dataclasses.fields(RunOptions)]
    by_name = pendmap.basins(BARE, 8, run=RunOptions(seed=2), threads=1)
    assert (by_name.attrs["seed"], by_name.attrs["threads"]) == (2, 1)
    same = pendmap.basins(BARE, 8, run=RunOptions(threads=1, seed=2))
    assert by_name.drop_attrs().equals(same.drop_attrs())
    with pytest.raises(TypeError, match="speed"):
        pendmap.basins(BARE, 4, speed=2)  # type: ignore[call-arg]


@pytest.mark.parametrize("name", RESULTS)
def test_every_function_checks_its_numerical_choices(name: str) -> None:
    known = inspect.signature(getattr(pendmap, name)).parameters
    for choice in REFUSED.keys() & known:
        value, text = REFUSED[choice]
        with pytest.raises(InputError, match=text):
            RESULTS[name](BARE, **{choice: value})


@pytest.mark.parametrize("name", RUNS)
def test_effects_that_no_map_can_have_are_refused(name: str) -> None:
    ever = Pendulum(effects=(Effect("drive_chirp", {"r": 0.001}),))
    with pytest.raises(InputError, match="drive_chirp"):
        RESULTS[name](ever)
