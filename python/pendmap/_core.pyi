from collections.abc import Callable, Sequence
from typing import Any, TypeAlias, TypedDict

import numpy as np
from numpy.typing import NDArray

from pendmap.model import Pendulum
from pendmap.model.effects import FormulaKey

__all__ = [
    "Diverged",
    "__version__",
    "acceleration",
    "advance",
    "basins_grid",
    "basins_list",
    "bifurcation",
    "bounds",
    "choose_steps",
    "counts_turns",
    "default_threads",
    "effects",
    "fit_equations",
    "fit_rows",
    "fit_runs",
    "formula",
    "growth",
    "lyapunov",
    "orbits",
    "parameter_map",
    "parameter_names",
    "period",
    "reckon",
    "replay",
    "roles",
    "simd",
    "simd_available",
    "simulate",
    "texture",
    "tongues",
]

class Diverged(ValueError): ...  # noqa: N818

__version__: str

_Axis: TypeAlias = tuple[float, float, int]
_Range: TypeAlias = tuple[str, Sequence[float]]
_Floats: TypeAlias = NDArray[np.float64]
_Progress: TypeAlias = Callable[[int, int], object]

_Free: TypeAlias = tuple[Sequence[tuple[int, str]], float]
_Window: TypeAlias = tuple[int, int, int, float, float]

class _Choices(TypedDict):
    tol: float
    max_periods: int | None
    layer_periods: int | None
    threads: int
    seed: int
    check: bool

class _ExponentChoices(TypedDict):
    precision: float
    tol: float
    max_periods: int | None
    threads: int
    seed: int

def simd() -> str: ...
def simd_available() -> list[str]: ...
def reckon(what: str, count: int, each: int) -> None: ...
def default_threads() -> int: ...
def roles() -> list[str]: ...
def effects() -> list[dict[str, Any]]: ...
def formula(given: FormulaKey) -> tuple[dict[str, Any], bool]: ...
def period(model: Pendulum) -> float: ...
def counts_turns(model: Pendulum) -> bool: ...
def bounds(model: Pendulum) -> tuple[int, int, int]: ...
def advance(
    model: Pendulum,
    theta: _Floats,
    velocity: _Floats,
    periods: int,
    steps_per_period: int,
    threads: int,
    progress: _Progress | None = None,
) -> tuple[_Floats, _Floats, NDArray[np.int64]]: ...
def choose_steps(
    model: Pendulum, theta: _Floats, velocity: _Floats, tol: float
) -> tuple[int, float]: ...
def acceleration(model: Pendulum, tau: _Floats, theta: _Floats, velocity: _Floats) -> _Floats: ...
def simulate(
    model: Pendulum,
    start: tuple[float, float],
    until: float,
    tol: float,
    samples: int,
    lyapunov: bool,
    live: Callable[[_Floats, _Floats, _Floats], object] | None = None,
) -> dict[str, Any]: ...
def basins_grid(
    model: Pendulum,
    theta: _Axis,
    velocity: _Axis,
    choices: _Choices,
    progress: _Progress | None = None,
) -> dict[str, Any]: ...
def basins_list(
    model: Pendulum,
    theta: _Floats,
    velocity: _Floats,
    choices: _Choices,
    progress: _Progress | None = None,
) -> dict[str, Any]: ...
def texture(labels: NDArray[np.int16], columns: int) -> dict[str, Any]: ...
def orbits(
    model: Pendulum,
    winding: tuple[int, int],
    theta: _Axis,
    velocity: _Axis,
    threads: int,
    progress: _Progress | None = None,
) -> dict[str, Any]: ...
def parameter_names(model: Pendulum) -> list[str]: ...
def parameter_map(
    model: Pendulum,
    axes: tuple[_Range, _Range],
    theta: _Floats,
    velocity: _Floats,
    each: int,
    tol: float,
    bound: int | None,
    threads: int,
    progress: _Progress | None = None,
) -> dict[str, Any]: ...
def bifurcation(
    model: Pendulum,
    axis: _Range,
    theta: _Floats,
    velocity: _Floats,
    each: int,
    first: tuple[float, float] | None,
    tol: float,
    bound: int | None,
    threads: int,
    progress: _Progress | None = None,
) -> dict[str, Any]: ...
def lyapunov(
    model: Pendulum,
    start: tuple[float, float],
    choices: _ExponentChoices,
    progress: _Progress | None = None,
) -> dict[str, Any]: ...
def growth(
    model: Pendulum,
    theta: _Floats,
    velocity: _Floats,
    windows: int,
    window: int,
    steps_per_period: int,
    threads: int,
    progress: _Progress | None = None,
) -> _Floats: ...
def tongues(
    model: Pendulum,
    inverted: bool,
    omegas: Sequence[float],
    p_max: float,
    folds: bool,
    threads: int,
    progress: _Progress | None = None,
) -> list[dict[str, Any]] | None: ...
def fit_runs(
    runs: Sequence[dict[str, Any]],
    free: Sequence[_Free],
    choices: dict[str, Any],
    windows: Sequence[_Window] | None = None,
) -> dict[str, Any]: ...
def fit_equations(
    runs: Sequence[dict[str, Any]],
    free: Sequence[_Free],
    tolerance: float,
    windows: Sequence[_Window],
) -> dict[str, Any]: ...
def fit_rows(
    runs: Sequence[dict[str, Any]],
    free: Sequence[_Free],
    tolerance: float,
    windows: Sequence[_Window],
) -> list[tuple[list[int], _Floats, _Floats, _Floats]]: ...
def replay(
    run: dict[str, Any],
    theta: _Floats,
    velocity: _Floats,
    times: _Floats,
    tolerance: float,
    threads: int,
    progress: _Progress | None = None,
) -> _Floats: ...
