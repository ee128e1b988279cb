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


def test_axes_may_be_tuples_and_counts_numpy_integers() -> None:
    grid = Grid((0, 1, 5), (np.float32(0), 1, np.int32(5)))  # type: ignore[arg-type]
    assert grid == Grid(Axis(0, 1, 5), Axis(0, 1, 5))
    assert type(grid.velocity.count) is int
    with pytest.raises(InputError, match=r"velocity must be an Axis, like .*, got 5"):
        Grid(Axis(0, 1, 5), 5)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ({"grid": 1.5}, r"grid must be a Grid, like 100, Grid\.square\(100\) .*, got 1\.5"),
        ({"pendulum": 0.6}, "pendulum must be a Pendulum, .*, got 0.6"),
        ({"tol": "a"}, "tol must be a number, got 'a'"),
        ({"max_periods": 10**14}, "max_periods must be a whole number from 1 to 2147.*, got 1"),
        ({"layer_periods": 0}, "layer_periods must be .*, got 0"),
        ({"check": "no"}, "check must be True or False, got 'no'"),
    ],
)
def test_basins_names_what_it_refuses(words: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        pendmap.basins(**({"pendulum": Pendulum(), "grid": Grid.square(5)} | words))


def test_basins_takes_whole_numbers_of_numpy() -> None:
    two: Any = np.int64(2)
    run = pendmap.RunOptions(threads=two, seed=two)
    result = pendmap.basins(Pendulum(), Grid.square(np.int16(4)), max_periods=two, run=run)
    assert result.attrs["max_periods"] == result.attrs["threads"] == result.attrs["seed"] == 2


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ({"theta": "pi"}, "theta must be a number, got 'pi'"),
        ({"until": None}, "until must be .*, got None"),
        (
            {"until": 1e12},
            r"until must be up to \d.* periods of 1 samples, got 3.18e\+11: more do not fit",
        ),
        ({"samples": 2.5}, "samples must be .*, got 2.5"),
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


def test_the_summary_states_the_interval_of_an_exponent() -> None:
    pendulum = Pendulum(p=1.7)
    run = pendmap.simulate(pendulum, math.pi / 2, 0, 200, lyapunov=True)
    for words in ("of this stretch, the first tenth left out", "Transients are included"):
        assert words in run.attrs["summary"]


def test_a_missed_tolerance_is_reported() -> None:
    # Rounding errors, magnified by chaos, exceed it.
    missed = pendmap.simulate(Pendulum(p=5, omega=0.5), 1, 0, 100, tol=1e-13)
    assert missed["reached_error"].item() > 1e-13
    assert "THE TOLERANCE 1e-13 WAS NOT REACHED" in missed.attrs["summary"]
    # Whole turns of the start cause no error.
    far, near = (pendmap.simulate(Pendulum(), 1 + turns, 0, 10) for turns in (2000 * math.pi, 0))
    assert abs(far.theta[-1] - near.theta[-1] - 2000 * math.pi) < 1e-8
    assert "TOLERANCE" not in pendmap.simulate(Pendulum(), 1, 0, 10).attrs["summary"]


def test_a_map_without_decided_cells_has_a_short_summary() -> None:
    result = pendmap.basins(Pendulum(), Grid.square(8), max_periods=1)
    summary = result.attrs["summary"]
    assert "100 % of the starts undecided within 1 period; --max-periods raises" in summary
    for words in ("agree", "NOT RELIABLE", "1 periods"):
        assert words not in summary
    one = pendmap.basins(
        Pendulum(), Grid(Axis(0.5, 0.6, 1), Axis(0, 1, 1)), run=pendmap.RunOptions(threads=1)
    )
    assert ": 1 start.\n" in one.attrs["summary"]
    assert "on 1 thread (" in one.attrs["summary"]
