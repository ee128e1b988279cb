from collections.abc import Callable, Sequence
from typing import Any, Self, TypeAlias, TypedDict, final

import numpy as np
from numpy.typing import NDArray

from pendmap.model import Pendulum
from pendmap.model.formula import FormulaKey

__all__ = [
    "Attractor",
    "BasinPlan",
    "Bifurcation",
    "BifurcationSet",
    "Continuation",
    "Diverged",
    "Ensemble",
    "Fit",
    "FitPoint",
    "FittedRun",
    "Followed",
    "LabelledStarts",
    "Lyapunov",
    "Orbit",
    "OrbitSearch",
    "ParameterMap",
    "Reliability",
    "Survey",
    "Texture",
    "TextureSum",
    "Tongues",
    "Trajectory",
    "Uncertainty",
    "WindowRows",
    "__version__",
    "acceleration",
    "advance",
    "bifurcation_set",
    "bounds",
    "choose_steps",
    "continuation",
    "counts_turns",
    "default_threads",
    "distance",
    "effects",
    "fit_rows",
    "fit_runs",
    "formula",
    "growth",
    "kinds",
    "lyapunov",
    "matched",
    "numbered",
    "orbits",
    "orbits_near",
    "parameter_names",
    "period",
    "rates",
    "reckon",
    "replay",
    "roles",
    "simd",
    "simd_available",
    "simulate",
    "thinned",
    "tongues",
]

class Diverged(ValueError): ...  # noqa: N818

__version__: str

_Axis: TypeAlias = tuple[float, float, int]
_Range: TypeAlias = Sequence[tuple[str, Sequence[float]]]
_Floats: TypeAlias = NDArray[np.float64]
_Places: TypeAlias = NDArray[np.int32]
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

_Pair: TypeAlias = tuple[float, float]

class Attractor:
    name: str
    plain: str
    pair: str
    kind: str
    rank: tuple[int, int, int]
    chaotic: bool
    n: int | None
    w: int
    lean: int
    turn: int
    points: list[_Pair]
    multipliers: list[_Pair]
    exponent: float
    exponent_stderr: float
    period: float | None
    twin: int | None
    fraction: float
    def __new__(cls, kind: str, n: int = 0, w: int = 0, lean: int = 0, turn: int = 0) -> Self: ...

@final
class Orbit(Attractor):
    residual: float
    stable: bool

@final
class OrbitSearch:
    orbits: list[Orbit]
    begun: int
    friction: bool

@final
class Continuation:
    n: _Places
    w: _Places
    symmetric: list[bool]
    kind: list[str]
    ends: list[tuple[str, str]]
    meets: list[tuple[int, int]]
    twin: _Places
    orbit_branch: _Places
    value: _Floats
    multipliers: _Floats
    phases: list[str]
    amplitude: _Floats
    swings: NDArray[np.int32]
    point_orbit: _Places
    theta: _Floats
    velocity: _Floats
    event_kind: list[str]
    event_orbit: _Places
    supercritical: _Places
    smooth: list[bool]
    regions: list[tuple[float, float]]
    stable: list[tuple[int, int]]
    sections: list[tuple[float, int]]

@final
class BifurcationSet:
    kind: list[str]
    n: _Places
    w: _Places
    symmetric: list[bool]
    ends: list[tuple[str, str]]
    meets: list[tuple[int, int]]
    curve: _Places
    at: _Floats
    theta: _Floats
    velocity: _Floats
    multipliers: _Floats
    supercritical: _Places
    jump: _Places
    degenerate_kind: list[str]
    degenerate_place: _Places
    sections: list[tuple[int, float, int, int]]
    types: list[tuple[str, int, int]]
    borders: list[tuple[int, int]]
    stable: list[NDArray[np.int16]]
    regions: list[tuple[int, float, float, float, int]]

@final
class Texture:
    basin_entropy: float
    boundary_basin_entropy: float
    boundary_stderr: float
    boxes: int
    boundary_boxes: int
    neighbours_agree: float
    chance: float
    @staticmethod
    def without_cells(labelled: bool) -> Texture: ...

@final
class BasinPlan:
    state: bytes
    plane: str
    layer_periods: int
    bound: int
    chaos_bound: int
    searched_starts: int
    steps_per_period: int
    reached_error: float
    simd: str
    def __new__(
        cls,
        model: Pendulum,
        starts: tuple[_Axis, _Axis] | tuple[_Floats, _Floats],
        choices: _Choices,
        state: bytes | None = None,
        progress: _Progress | None = None,
        near: BasinPlan | None = None,
    ) -> BasinPlan: ...
    def map(self, progress: _Progress | None = None) -> tuple[LabelledStarts, Texture]: ...
    def label(self, first: int, last: int, progress: _Progress | None = None) -> LabelledStarts: ...
    def label_again(
        self, picks: NDArray[np.int64], progress: _Progress | None = None
    ) -> LabelledStarts: ...
    def further(self, theta: _Floats, velocity: _Floats) -> NDArray[np.int16] | None: ...
    def checked_starts(self) -> NDArray[np.int64]: ...
    def reliability(self, labels: NDArray[np.int16]) -> Reliability: ...
    def uncertainty(self, labels: NDArray[np.int16], columns: int) -> Uncertainty | None: ...
    def finish(self, counts: NDArray[np.int64]) -> tuple[list[Attractor], NDArray[np.int16]]: ...

@final
class LabelledStarts:
    label: NDArray[np.int16]
    settle: NDArray[np.int32]
    turns: NDArray[np.int32]
    finite_time_exponent: NDArray[np.float32] | None
    work: int
    open_theta: _Floats
    open_velocity: _Floats

@final
class Reliability:
    unreliable: float
    unreliable_half_step: float
    unreliable_mirror: float | None
    labels_sampled: int

@final
class Uncertainty:
    eps: _Floats
    uncertain: NDArray[np.uint64]
    tried: NDArray[np.uint64]

@final
class TextureSum:
    def __new__(cls, columns: int, rows: int) -> TextureSum: ...
    def add(self, labels: NDArray[np.int16]) -> None: ...
    def total(self) -> Texture: ...

@final
class Trajectory:
    time: _Floats
    theta: _Floats
    velocity: _Floats
    reached_error: float
    end_error: float
    steps_per_period: int
    exponent: _Pair | None
    stuck: bool
    interrupted: bool
    event_time: _Floats
    event_theta: _Floats
    event_kind: list[str]

class ParameterMap:
    cell: _Places
    kinds: list[Attractor]
    kind: NDArray[np.int16]
    n: _Places
    w: _Places
    theta: _Floats
    velocity: _Floats
    exponent: _Floats
    exponent_stderr: _Floats
    share: _Floats
    undecided: _Floats
    failed: _Floats
    chaos_periods: NDArray[np.uint32]
    reached_error: float
    searched_again: int
    simd: str

@final
class Followed:
    on: _Places
    value: _Places
    theta: _Floats
    velocity: _Floats

@final
class Bifurcation(ParameterMap):
    branch: _Places
    point_entry: _Places
    point_theta: _Floats
    point_velocity: _Floats
    up: Followed
    down: Followed

@final
class Survey:
    def __new__(
        cls,
        model: Pendulum,
        axes: Sequence[_Range],
        theta: _Floats,
        velocity: _Floats,
        each: int,
        tol: float,
        bound: int | None,
        threads: int,
        state: bytes | None = None,
    ) -> Survey: ...
    @property
    def state(self) -> bytes: ...
    @property
    def blocks(self) -> int: ...
    @property
    def passes(self) -> int: ...
    def cells(self, block: int) -> list[int]: ...
    def around(self, block: int) -> list[int]: ...
    def search(self, block: int, progress: _Progress | None = None) -> bytes: ...
    def exchange(
        self,
        pass_number: int,
        block: int,
        known: dict[int, bytes],
        progress: _Progress | None = None,
    ) -> bytes | None: ...
    def gained(self, pass_number: int, block: int, found: bytes) -> bool: ...
    def result(self, blocks: Sequence[bytes]) -> ParameterMap: ...
    def diagram(
        self, blocks: Sequence[bytes], first: tuple[float, float] | None = None
    ) -> Bifurcation: ...

@final
class Lyapunov:
    end: str
    attractor: Attractor | None
    transient: int | None
    lost: int
    course: _Floats
    bound: int
    chaos_bound: int
    steps_per_period: int
    reached_error: float
    simd: str
    window: int
    ensemble: Ensemble | None

@final
class Ensemble:
    growth: _Floats
    dropped: int
    exponent: _Pair
    sum: _Pair

@final
class Tongues:
    index: NDArray[np.int32]
    inverted: list[bool]
    p: _Floats
    multiplier: _Floats
    above: list[bool]
    first: list[tuple[bool, bool]]
    upright: bool
    curves: BifurcationSet | None

class FitPoint:
    values: _Floats
    chi2: float
    samples: int
    degrees: int
    information: _Floats
    pull: _Floats
    windows: list[_Window]
    runs: list[FittedRun]

@final
class Fit(FitPoint):
    covariance: _Floats
    intervals: list[_Pair]
    widening: float
    steps: int
    stages: int
    converged: bool
    given_up: bool

@final
class FittedRun:
    theta: _Floats
    velocity: _Floats
    residual: _Floats
    white: _Floats

@final
class WindowRows:
    free: list[int]
    rows: _Floats
    residuals: _Floats
    weights: _Floats

def simd() -> str: ...
def simd_available() -> list[str]: ...
def kinds() -> list[str]: ...
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
def rates(
    model: Pendulum, tau: _Floats, theta: _Floats, velocity: _Floats
) -> tuple[_Floats, _Floats, _Floats]: ...
def simulate(
    model: Pendulum,
    start: tuple[float, float],
    until: float,
    tol: float,
    samples: int,
    lyapunov: bool,
    live: Callable[[_Floats, _Floats, _Floats], object] | None = None,
    times: Sequence[float] = ...,
) -> Trajectory: ...
def thinned(count: int, others: int) -> NDArray[np.int64]: ...
def orbits(
    model: Pendulum,
    winding: tuple[int, int],
    theta: _Axis,
    velocity: _Axis,
    threads: int,
    progress: _Progress | None = None,
) -> OrbitSearch: ...
def continuation(
    model: Pendulum,
    along: tuple[Sequence[float], _Range],
    sought: tuple[int, int | None],
    longest: int,
    starts: Sequence[tuple[float, float, int, float]] | None,
    threads: int,
    progress: _Progress | None = None,
) -> Continuation: ...
def bifurcation_set(
    model: Pendulum,
    axes: tuple[tuple[Sequence[float], _Range], tuple[Sequence[float], _Range]],
    longest: int,
    regions: bool,
    threads: int,
    progress: _Progress | None = None,
) -> BifurcationSet: ...
def orbits_near(
    model: Pendulum,
    along: Sequence[tuple[str, float, float]],
    steps: int,
    states: Sequence[tuple[float, float, int | None, bool | None]],
) -> list[tuple[int, list[_Pair]] | None]: ...
def distance(
    one: Sequence[Sequence[float]], other: Sequence[Sequence[float]], circle: bool = True
) -> float: ...
def matched(
    old: Sequence[Sequence[Sequence[float]]],
    new: Sequence[Sequence[Sequence[float]]],
    reach: Sequence[Sequence[float]],
    continued: Sequence[tuple[int, int]] = ...,
    circle: bool = True,
) -> list[tuple[bool, float, int, int]]: ...
def numbered(
    sizes: Sequence[int], links: Sequence[tuple[tuple[int, int], tuple[int, int]]]
) -> list[list[int]]: ...
def parameter_names(model: Pendulum) -> list[str]: ...
def lyapunov(
    model: Pendulum,
    start: tuple[float, float],
    choices: _ExponentChoices,
    progress: _Progress | None = None,
) -> Lyapunov: ...
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
    omegas: Sequence[float],
    p_max: float,
    threads: int,
    progress: _Progress | None = None,
) -> Tongues: ...
def fit_runs(
    runs: Sequence[dict[str, Any]],
    free: Sequence[_Free],
    choices: dict[str, Any],
    windows: Sequence[_Window] | None = None,
) -> Fit: ...
def fit_rows(
    runs: Sequence[dict[str, Any]],
    free: Sequence[_Free],
    tolerance: float,
    windows: Sequence[_Window],
) -> list[WindowRows]: ...
def replay(
    run: dict[str, Any],
    theta: _Floats,
    velocity: _Floats,
    times: _Floats,
    tolerance: float,
    threads: int,
    progress: _Progress | None = None,
) -> _Floats: ...
