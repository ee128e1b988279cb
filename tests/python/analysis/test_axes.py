"""Parameters that vary: values in any order, curves, the drive in quantities of the laboratory."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from models import DRAG
from pendmap import Axis, Formula, Grid, InputError, Pendulum, Rig, RunOptions
from pendmap.analysis.orbit_table import attractors_of

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

OWN = Formula("own_pull", "-k*sin(2*theta)", {"k": 2})
BARE = Pendulum(gamma=0.1, p=0.6, omega=2.0, effects=(DRAG, OWN(k=0.01)))
SI = Rig(w0=6.2, c_over_m=0.7, p=0.6, Omega=12.1, effects=(DRAG,))


def test_an_array_has_the_centres_of_cells() -> None:
    grid = Grid(theta=np.linspace(-1, 1, 5), velocity=[0.5, 1.5, 2.5, 3.5])
    assert grid.theta == Axis(-1.25, 1.25, 5)
    assert grid.velocity.centres == pytest.approx([0.5, 1.5, 2.5, 3.5], abs=1e-15)
    for values in (np.geomspace(0.1, 1, 5), [1.0], np.array([])):
        with pytest.raises(InputError, match=r"^velocity must be [^\n]*$"):
            Grid(velocity=values)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "more"), [("bifurcation", {}), ("parameter_map", {"omega": (1.9, 2.1, 2)})]
)
def test_values_may_be_uneven_and_may_fall(name: str, more: dict[str, Any], tmp_path: Path) -> None:
    found = functools.partial(getattr(pendmap, name), Pendulum(), starts=4)
    rising = found({"p": (0.3, 0.9, 3), **more})
    assert found({"p": (0.9, 0.3, 3), **more}).drop_attrs().equals(rising.drop_attrs())
    assert found({"p": np.linspace(0.3, 0.9, 3), **more}).drop_attrs().equals(rising.drop_attrs())
    values, run = [0.3, 0.5, 0.9], RunOptions(store=tmp_path / "a.zarr")
    listed = found({"p": np.array(values[::-1]), **more}, run=run)
    assert listed.p.values.tolist() == values
    again = found({"p": values, **more}, run=dataclasses.replace(run, resume=True))
    assert again.drop_attrs().equals(listed.drop_attrs())


def test_a_selected_value_is_in_the_model() -> None:
    swept = functools.partial(pendmap.sweep, grid=5, check=False)
    both = swept(BARE, {"p": [0.5, 0.7], "quadratic_drag.q": [0.01, 0.03]})
    one = pendmap.pendulum_of(both.isel({"p": 1, "quadratic_drag.q": 0}))
    assert (one.p, one.effects[0].parameters["q"]) == (0.7, 0.01)
    assert one.effects[1] == BARE.effects[1]
    slow = pendmap.pendulum_of(swept(SI, {"frequency_hz": [1.5, 2.0]}).isel(frequency_hz=0))
    assert slow.Omega == pytest.approx(3 * np.pi)
    braked = pendmap.pendulum_of(swept(SI, {"torque": [0.01, 0.02]}).isel(torque=1))
    assert braked.pendulum.torque == pytest.approx(0.02)


STROKE: dict[str, Any] = {"w0": 6.2, "c_over_m": 0.62, "Tr": 0.1, "stroke_mm": 30.0}
UNEVEN = (1.9, 2.0, 2.3)  # Hz


def same_as_alone(swept: xr.Dataset, at: dict[str, int], model: Pendulum | Rig) -> None:
    """Compare one map of a sweep with the basins of its model alone, by shares and attractors."""
    here, alone = swept.isel(at), pendmap.basins(model, 16, check=False)
    shares = here.fraction.values[here.exists.values > 0]
    assert np.sort(shares) == pytest.approx(np.sort(alone.fraction.values), abs=0.004)
    assert pendmap.pendulum_of(here) == model


@pytest.mark.parametrize(
    ("name", "factor"), [("frequency_hz", 1.0), ("Omega", math.tau), ("omega", math.tau / 6.2)]
)
def test_a_given_stroke_stays_where_the_frequency_varies(name: str, factor: float) -> None:
    rig = Rig.of(**STROKE, frequency_hz=1.5)
    found = pendmap.sweep(rig, {name: factor * np.array(UNEVEN)}, grid=16, check=False)
    for k, hertz in enumerate(UNEVEN):
        one = Rig.of(**STROKE, frequency_hz=hertz)
        assert found.p.values[k] == pytest.approx(one.p, rel=1e-14)
        if name == "frequency_hz":
            same_as_alone(found, {name: k}, one)
    assert float(found.fraction.isel({name: 2}).max()) < 0.9  # rotations exist
    says = "The stroke Y = 30 mm is constant: p = 0.4358 to 0.6387 by p = Y Omega^2/g"
    assert says in found.attrs["summary"]
    wide = {name: factor * np.array(UNEVEN), "c_over_m": [0.5, 0.6]}
    for result in (found, pendmap.parameter_map(rig, wide, starts=3)):
        known = pendmap.files.facts(result)
        assert (known["kept"], known["stroke_mm"]) == ("stroke_mm", 30.0)
        assert result.p.dims == (name,)


def test_a_given_p_stays_where_the_frequency_varies() -> None:
    fixed = dataclasses.replace(Rig.of(**STROKE, frequency_hz=1.9), p=0.4)
    found = pendmap.sweep(fixed, {"frequency_hz": [1.9, 2.3]}, grid=16, check=False)
    assert (found.p.values, found.attrs["kept"]) == (0.4, "p")
    assert "p = 0.4 is constant, as the model gives it: not the stroke" in found.attrs["summary"]
    same_as_alone(found, {"frequency_hz": 1}, dataclasses.replace(fixed, Omega=2.3 * math.tau))
    for ranges in ({"p": [0.2, 0.4]}, {"stroke_mm": [10.0, 20.0]}):
        assert "kept" not in pendmap.bifurcation(fixed, ranges).attrs


def test_stroke_and_frequency_vary_together() -> None:
    rig, ranges = Rig(w0=6.2, c_over_m=0.62, Tr=0.1), {"stroke_mm": [20.0, 30.0]}
    found = pendmap.sweep(rig, ranges | {"frequency_hz": [*UNEVEN]}, grid=16, check=False)
    for j, k in ((0, 0), (0, 2), (1, 1)):
        one = Rig.of(**STROKE | {"stroke_mm": ranges["stroke_mm"][j]}, frequency_hz=UNEVEN[k])
        same_as_alone(found, {"stroke_mm": j, "frequency_hz": k}, one)
    curve = {"frequency_hz": [1.2, 1.6, 2.0], "stroke_mm": [60.0, 45.0, 20.0]}
    along = pendmap.bifurcation(rig, curve)
    pairs = zip(curve["stroke_mm"], curve["frequency_hz"], strict=True)
    own_p = [1e-3 * mm * (2 * np.pi * hertz) ** 2 / 9.81 for mm, hertz in pairs]
    assert along.p.values == pytest.approx(own_p)


def test_an_axis_may_be_any_curve(tmp_path: Path) -> None:
    source = np.random.default_rng(4)
    curve = {"p": np.sort(source.uniform(0.2, 1.2, 3)), "omega": source.uniform(1.6, 2.4, 3)}
    ranges = {"any": curve, "gamma": [0.1, 0.14]}
    found = pendmap.sweep(Pendulum(), ranges, grid=16, check=False)
    assert found.omega.dims == ("p",)
    for k in range(3):
        one = Pendulum(gamma=0.14, **{name: float(x[k]) for name, x in curve.items()})
        same_as_alone(found, {"p": k, "gamma": 1}, one)
    run = RunOptions(store=tmp_path / "b.zarr")
    diagram = pendmap.bifurcation(Pendulum(), curve, run=run)
    turned = {"c": {name: own[::-1] for name, own in curve.items()}}
    again = pendmap.bifurcation(Pendulum(), turned, run=dataclasses.replace(run, resume=True))
    assert again.identical(diagram)
    map_ = pendmap.parameter_map(Pendulum(), {"c": curve, "gamma": [0.1]})
    kinds = sorted(map_.kind.values[map_.entry_kind.values])
    pairs = [one.pair for one in attractors_of(diagram, "kind_")]  # mirror images are one in a map
    assert kinds == sorted(pairs[k] for k in diagram.entry_kind.values)
