"""Arguments from Python: accepted in any numeric type, or refused by name."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import xarray as xr

import pendmap
from pendmap import Axis, Grid, InputError, Pendulum
from pendmap.analysis import summary

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("p", [np.float32(0.5), np.int64(1), np.array(0.5), Fraction(1, 2), 1])
def test_any_real_number_is_a_parameter(p: Any) -> None:  # noqa: ANN401
    pendulum = Pendulum(p=p)
    assert type(pendulum.p) is float
    assert pendulum.p == p


@pytest.mark.parametrize(
    "p", [10**400, 10**5000, 1j, np.True_, None, [1.0], "1" * 500], ids=lambda p: type(p).__name__
)
def test_invalid_parameters_are_refused_on_one_short_line(p: Any) -> None:  # noqa: ANN401
    with pytest.raises(InputError, match=r"p must be .*, got ") as error:
        Pendulum(p=p)
    assert len(str(error.value)) < 150


@pytest.mark.parametrize(
    "axis",
    [
        *((0, 1, 2.5), (0, 1, True), (0, 1, "5"), ("0", 1, 5), (-1e308, 1e308, 5), (1, 1, 5)),
        *((2, 1, 5), (math.nan, 1, 5), (0, 1, 0), (0, 1, 10**6)),
    ],
)
def test_invalid_axes_are_refused(axis: tuple[Any, Any, Any]) -> None:
    with pytest.raises(InputError, match="must be"):
        Axis(*axis)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ({"grid": 1.5}, r"grid must be a Grid, like 100, Grid\.square\(100\) .*, got 1\.5"),
        ({"pendulum": 0.6}, "pendulum must be a Pendulum, .*, got 0.6"),
        ({"max_periods": 10**14}, "max_periods must be a whole number from 1 to 2147.*, got 1"),
        ({"check": "no"}, "check must be True or False, got 'no'"),
    ],
)
def test_basins_names_what_it_refuses(words: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        pendmap.basins(**({"pendulum": Pendulum(), "grid": Grid.square(5)} | words))


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ({"theta": "pi"}, "theta must be a number, got 'pi'"),
        (
            {"until": 1e12},
            r"must be a time up to \d.*, got 1e\+12: .* periods do not fit into memory",
        ),
        ({"lyapunov": 1}, "lyapunov must be .*, got 1"),
    ],
)
def test_simulate_names_what_it_refuses(words: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        pendmap.simulate(
            **({"pendulum": Pendulum(), "theta": 1, "velocity": 0, "until": 9} | words)
        )


@pytest.mark.parametrize("start", [3, (1.0,), (1.0, 2.0, 3.0), ("a", 1.0), ((1.0, 2.0), 3.0)])
def test_sweeps_start_from_an_angle_and_a_velocity(start: Any) -> None:  # noqa: ANN401
    with pytest.raises(InputError, match="start must be"):
        pendmap.bifurcation(Pendulum(), {"p": (0.5, 0.6, 2)}, start=start)


@pytest.mark.parametrize("function", [pendmap.basins_of, pendmap.advance])
@pytest.mark.parametrize("theta", ["pi", ["a", "b"], 1.0, [[1.0, 2.0]], [math.nan, 1.0], [1.0]])
def test_lists_of_starts_are_refused(function: Any, theta: Any) -> None:  # noqa: ANN401
    rest = (1,) if function is pendmap.advance else ()
    with pytest.raises(InputError, match="theta"):
        function(Pendulum(), theta, [0.0, 0.0], *rest)


def test_only_results_are_saved(tmp_path: Path) -> None:
    for other in (xr.Dataset({"a": 1}), {"a": 1}):
        with pytest.raises(InputError, match="not a result of pendmap"):
            pendmap.save(other, tmp_path / "f.nc")  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


# Statements of summaries


def test_a_missed_tolerance_is_reported() -> None:
    # Rounding errors, magnified by chaos, exceed it.
    missed = pendmap.simulate(Pendulum(p=5, omega=0.5), 1, 0, 100, tol=1e-13)
    assert missed["reached_error"].item() > 1e-13
    assert "THE TOLERANCE 1e-13 WAS NOT REACHED" in missed.attrs["summary"]
    # Whole turns of the start cause no error.
    far, near = (pendmap.simulate(Pendulum(), 1 + turns, 0, 10) for turns in (2000 * math.pi, 0))
    assert abs(far.theta[-1] - near.theta[-1] - 2000 * math.pi) < 1e-8
    assert "TOLERANCE" not in pendmap.simulate(Pendulum(), 1, 0, 10).attrs["summary"]


def test_a_bound_that_was_shortened_because_of_chaos_is_explained() -> None:
    result = pendmap.basins(Pendulum(p=1.52, omega=1.1), Grid.square(30), check=False)
    assert result.attrs["max_periods"] < 4000
    # This bound makes a few starts appear to take longer.
    result["undecided"] = 0.02
    result.attrs["summary"] = summary.summarise(
        result, pendmap.Pendulum(p=1.7), bound_was_chosen=True, decided=882, moving=18
    )
    assert "where chaos coexists, ten times the longest settling" in result.attrs["summary"]
