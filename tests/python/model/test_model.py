"""The pendulum's parameters and model files."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest

from pendmap import PRESETS, InputError, Pendulum, load_model

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize(
    ("name", "value", "wanted"),
    [
        ("gamma", -1.0, "0 or more"),
        ("gamma", math.nan, "finite"),
        ("p", math.inf, "finite"),
        ("omega", 0.0, "above 0"),
        ("omega", -2.0, "above 0"),
        ("phase", math.nan, "finite"),
        ("torque", "much", "a number"),
        ("torque", True, "a number"),
        ("theta_r", -0.1, "0 or more"),
        ("theta_r", math.inf, "finite"),
    ],
)
def test_parameters_outside_their_range_are_refused_by_name(
    name: str, value: object, wanted: str
) -> None:
    with pytest.raises(InputError, match=f"{name} must be .*{wanted}.*, got "):
        Pendulum(**{name: value})  # type: ignore[arg-type]


def test_the_unit_of_periods() -> None:
    assert Pendulum(omega=0.87).period == pytest.approx(math.tau / 0.87)
    assert Pendulum(p=0, omega=0.87).period == pytest.approx(math.tau)


def test_presets_are_the_points_of_figure_2() -> None:
    points = {name: (x.gamma, x.p, x.omega) for name, x in PRESETS.items()}
    assert points == {
        "fig2a": (0.1, 1.03, 0.87),
        "fig2b": (0.1, 1.7, 0.87),
        "fig2c": (0.1, 1.5, 1.8),
    }


def test_a_key_that_a_model_file_leaves_out_is_zero(tmp_path: Path) -> None:
    file = tmp_path / "model.toml"
    file.write_text("[pendulum]\ngamma = 0.2\np = 1.5\nomega = 1.8\n", encoding="utf-8")
    assert load_model(file) == Pendulum(gamma=0.2, p=1.5, omega=1.8, phase=0, torque=0)
