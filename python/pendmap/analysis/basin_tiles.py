"""Basins in tiles: labels of the starts, further searches, measures of the whole.

The plan (step, attractors, bound) comes from a sample of all starts. In the step ``label`` each
tile labels its starts; while some are undecided, a search from at most 256 of them, taken at equal
ranks from all, may find more attractors, and the step ``again-K`` labels the undecided ones again.
Measures and the final numbers of the attractors come last, from tile to tile in their order.
"""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap import _core
from pendmap.engine import pack, unpack
from pendmap.errors import core_errors

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from pendmap.engine import Store, Work
    from pendmap.model import Pendulum
    from pendmap.signal import Floats, Indices, Mask

    Axes = tuple[tuple[float, float, int], tuple[float, float, int]]
    Labels = NDArray[np.int16]
    Cells = dict[str, NDArray[Any]]

TILE: Final = 2**20
"""Largest number of starts of a tile: 0.3 CPU seconds of a smooth map, 5 of a chaotic one."""
_LEAST_TILE: Final = 2**18
_TILES: Final = 64  # Least number of tiles of a map of larger ones: workers end together
_BOX: Final = 5  # Tiles begin with a row of boxes of the basin entropy
_SAMPLE: Final = 256  # Largest number of undecided starts from which a further search begins
_CELLS: Final = {"label": "int16", "settle_periods": "int32", "net_turns": "int32"}
_EXPONENT: Final = {"finite_time_exponent": "float32"}
_BYTES: Final = 32  # Memory of a start during the computation
_DONE: Final = 16  # Memory of a start of a map in tiles
_STILL: Final = 1e-12  # Largest sine of an angle at rest
_TEXTURE: Final = (
    "basin_entropy",
    "boundary_basin_entropy",
    "boundary_stderr",
    "boundary_boxes",
    "neighbours_agree",
    "chance",
)
_RELIABILITY: Final = (
    "unreliable",
    "unreliable_half_step",
    "unreliable_mirror",
    "labels_sampled",
)
_PLAN: Final = (
    "plane",
    "layer_periods",
    "bound",
    "chaos_bound",
    "searched_starts",
    "steps_per_period",
    "reached_error",
    "simd",
)


_NOTHING: Final = np.zeros(0)


def tile_of(cells: int, most: int = TILE) -> int:
    """Return the number of starts of a tile of a map."""
    return min(most, max(_LEAST_TILE, cells // _TILES))


class Starts:
    """The starts of a map: a grid by its axes, or a list of states; without dimensions.

    A worker gets the states of a list tile by tile, not with the job.
    """

    def __init__(
        self, axes: Axes | None, theta: Floats = _NOTHING, velocity: Floats = _NOTHING
    ) -> None:
        self.axes = axes
        self.theta, self.velocity = theta, velocity
        self.shape = (theta.size,) if axes is None else (axes[1][2], axes[0][2])
        """Shape of the arrays with a value for each start."""

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "theta": _NOTHING, "velocity": _NOTHING}

    def of_tile(self, first: int, last: int) -> Any:  # noqa: ANN401 (of two kinds)
        """Return the starts that a tile needs: all axes of a grid, the states of a list."""
        if self.axes is not None:
            return self.axes
        return self.theta[first:last], self.velocity[first:last]

    @property
    def dims(self) -> tuple[str, ...]:
        """Dimensions of these arrays."""
        return ("start",) if self.axes is None else ("velocity", "theta")

    @property
    def row(self) -> int:
        """Number of starts in a row."""
        return 1 if self.axes is None else self.axes[0][2]

    def height(self, cells: int) -> int:
        """Return the number of rows, of whole boxes, with about ``cells`` starts."""
        return min(_BOX * -(-cells // (_BOX * self.row)), self.shape[0])

    def at_rest(self, rows: slice) -> Mask:
        """Return which starts of these rows are exactly at rest, hanging or inverted."""
        if self.axes is None:
            theta, velocity = self.theta[rows], self.velocity[rows]
        else:
            (low, high, count), (slow, fast, number) = self.axes
            theta = np.asarray(low + (np.arange(count) + 0.5) * ((high - low) / count))
            lines = np.arange(number)[rows, np.newaxis] + 0.5
            velocity = np.asarray(slow + lines * ((fast - slow) / number))
        still: Mask = (np.abs(np.sin(theta)) < _STILL) & (velocity == 0)
        return still


@dataclasses.dataclass(frozen=True)
class BasinTiles:
    """The job of a basin map."""

    pendulum: Pendulum
    starts: Starts
    choices: _core._Choices
    rate: float = 1.0
    """Exponents of the model for one without dimensions."""
    cells: int | None = None
    """Number of starts of a tile; None for a single tile."""
    threads: int | None = None
    """Threads of a tile; by default those of the choices, which the search and the checks have."""
    at_once: int = 1
    """Number of tiles that this process computes at once."""

    @property
    def height(self) -> int:
        """Number of rows of a tile."""
        return self.starts.shape[0] if self.cells is None else self.starts.height(self.cells)

    @property
    def tiles(self) -> int:
        """Number of tiles."""
        return -(-self.starts.shape[0] // self.height)

    def rows(self, tile: int) -> slice:
        """Return the rows of a tile."""
        return slice(tile * self.height, min((tile + 1) * self.height, self.starts.shape[0]))

    def plan(
        self,
        state: bytes | None = None,
        starts: Any = None,  # noqa: ANN401 (axes or states)
        progress: Any = None,  # noqa: ANN401
    ) -> _core.BasinPlan:
        """Return the plan of a record for the starts of a tile or all, or search for attractors."""
        choices = self.choices
        if starts is not None and self.threads is not None:
            choices = {**choices, "threads": self.threads}
        starts = starts or self.starts.of_tile(0, self.starts.shape[0])
        with core_errors():
            return _core.BasinPlan(self.pendulum, starts, choices, state, progress)

    # ---- tiles

    def inputs(self, store: Store, step: str, tile: int) -> tuple[Any, Indices]:
        """Return the starts of a tile, and the indices of the undecided ones."""
        starts = self.starts.of_tile(self._first(tile), self._first(tile + 1))
        if step == "label":
            return starts, np.zeros(0, np.int64)
        return starts, self._undecided(store, int(step.removeprefix("again-")), tile)

    def tile(
        self,
        step: str,
        state: bytes,
        tile: int,
        inputs: tuple[Any, Indices],
        progress: Any = None,  # noqa: ANN401
    ) -> dict[str, NDArray[Any]]:
        """Label the starts of a tile, or its undecided ones again."""
        starts, picks = inputs
        plan = self.plan(state, starts)
        first, last = self._first(tile), self._first(tile + 1)
        before = 0 if self.starts.axes else first  # starts that the plan does not have
        if step != "label":
            labelled = plan.label_again(picks - before, progress)
            arrays = {"label": labelled.label, "settle": labelled.settle, "turns": labelled.turns}
            return pack(picks=picks, work=labelled.work, **arrays)
        labelled = plan.label(first - before, last - before, progress)
        cells: Cells = dict(
            zip(_CELLS, (labelled.label, labelled.settle, labelled.turns), strict=True)
        )
        if labelled.finite_time_exponent is not None:
            exponent = labelled.finite_time_exponent * np.float32(self.rate)
            cells["finite_time_exponent"] = exponent
        undecided = np.count_nonzero(labelled.label == 0)
        return pack(work=labelled.work, undecided=undecided, **cells)

    def _first(self, tile: int) -> int:
        """Return the index of the first start of a tile."""
        return min(tile * self.height, self.starts.shape[0]) * self.starts.row

    def _undecided(self, store: Store, again: int, tile: int) -> Indices:
        """Return the indices of the starts of a tile that are labelled in a step ``again``."""
        if again > 1:
            record = store.get(f"again-{again - 1}/{tile}")
            if record is None:
                return np.zeros(0, np.int64)
            arrays = unpack(record)
            picks: Indices = arrays["picks"][arrays["label"] == 0]
            return picks
        label = unpack(store.get(f"label/{tile}") or {})["label"]
        return np.flatnonzero(label == 0) + self._first(tile)

    # ---- the whole

    def run(self, work: Work, *, check: bool) -> SimpleNamespace:
        """Compute what is missing; return attractors and measures by the names of the schema."""
        store, shape = work.store, self.starts.shape
        _core.reckon("starts", math.prod(shape), _BYTES if self.cells is None else _DONE)
        plan = self.plan(work.once("plan-0", lambda: self.plan(progress=work.progress).state))
        labelled = plan.plane == "basins"
        undecided = np.zeros(self.tiles, np.int64)
        periods = 0
        for tile, record in work.each("label", "plan-0", range(self.tiles)):
            arrays = unpack(record)
            undecided[tile] = int(arrays["undecided"])
            periods += int(arrays["work"])
        moves: list[Labels] = []
        while labelled and undecided.any():
            again = len(moves) + 1
            search = partial(self._search, plan, store, undecided, again)
            further = unpack(work.once(f"search-{again}", search))
            if "moved" not in further:
                break
            moves.append(further["moved"])
            plan = self.plan(work.once(f"plan-{again}", further["state"].tobytes))
            tiles = np.flatnonzero(undecided).tolist()
            for tile, record in work.each(f"again-{again}", f"plan-{again}", tiles):
                arrays = unpack(record)
                undecided[tile] = np.count_nonzero(arrays["label"] == 0)
                periods += int(arrays["work"])
        measure = partial(self._measures, plan, store, moves, check=check)
        measures = unpack(work.once("measures", measure))
        counts = measures.pop("counts")
        attractors, last = plan.finish(np.ascontiguousarray(counts[2:]))
        if moves or not np.array_equal(last, np.arange(1, last.size + 1)):
            moves.append(last)
        share = counts[:2] / math.prod(shape)
        uncertain = {
            name: measures.pop(name, np.zeros(0)) for name in ("eps", "uncertain", "tried")
        }
        texture = SimpleNamespace(**{name: measures.pop(name).item() for name in _TEXTURE})
        measures = {name: value.item() for name, value in measures.items()}
        return SimpleNamespace(
            **{name: getattr(plan, name) for name in _PLAN},
            **dict.fromkeys(_RELIABILITY, 0.0) | {"unreliable_mirror": None} | measures,
            attractors=attractors,
            cells=self._final(store, moves),
            failed=share[0].item(),
            undecided=1.0 if plan.plane == "conservative" else share[1].item(),
            decided=int(counts[2:].sum()),
            mean_periods=periods / math.prod(shape),
            texture=texture,
            uncertainty=uncertain,
        )

    def _search(
        self, plan: _core.BasinPlan, store: Store, undecided: Indices, again: int
    ) -> dict[str, NDArray[Any]]:
        """Search from undecided starts; return the next plan, none if labels are final."""
        stride = -(-int(undecided.sum()) // _SAMPLE)
        before = np.cumsum(undecided) - undecided
        picks = []
        for tile in np.flatnonzero(undecided).tolist():
            ranks = np.arange(-before[tile] % stride, undecided[tile], stride)
            if ranks.size:
                picks.append(self._undecided(store, again, tile)[ranks])
        with core_errors():
            ends = plan.label_again(np.concatenate(picks))
            moved = plan.further(ends.open_theta, ends.open_velocity)
        if moved is None:
            return pack(final=1)
        return pack(moved=moved, state=np.frombuffer(plan.state, np.uint8))

    def _merged(self, store: Store, moves: list[Labels], tile: int) -> Cells:
        """Return the cells of a tile with what the steps ``again`` have found.

        Entry ``k`` of ``moves`` has the new number of each attractor after step ``k``.
        """
        shape = (-1, *self.starts.shape[1:])
        arrays = unpack(store.get(f"label/{tile}") or {})
        names = [name for name in (*_CELLS, *_EXPONENT) if name in arrays]
        cells = {name: arrays[name].reshape(shape) for name in names}
        if moves:
            cells = {name: values.copy() for name, values in cells.items()}
        flat = {name: values.reshape(-1) for name, values in cells.items()}
        for k, moved in enumerate(moves):
            label = flat["label"]
            label[label > 0] = moved[label[label > 0] - 1]
            record = store.get(f"again-{k + 1}/{tile}")
            if record is not None:
                arrays = unpack(record)
                at = arrays["picks"] - self._first(tile)
                for name, key in zip(_CELLS, ("label", "settle", "turns"), strict=True):
                    flat[name][at] = arrays[key]
        return cells

    def _blocks(self, store: Store, moves: list[Labels]) -> Iterator[tuple[slice, Cells]]:
        """Yield rows and cells, a few rows at a time."""
        few = self.starts.height(TILE)
        for tile in range(self.tiles):
            cells, rows = self._merged(store, moves, tile), self.rows(tile)
            for first in range(rows.start, rows.stop, few):
                last = min(first + few, rows.stop)
                part = slice(first - rows.start, last - rows.start)
                yield slice(first, last), {name: values[part] for name, values in cells.items()}

    def _measures(
        self,
        plan: _core.BasinPlan,
        store: Store,
        moves: list[Labels],
        *,
        check: bool,
    ) -> dict[str, NDArray[Any]]:
        """Return what the whole map tells."""
        rows, row = self.starts.shape[0], self.starts.row
        labelled = plan.plane == "basins"
        grid, check = labelled and self.starts.axes is not None, labelled and check
        picks = plan.checked_starts() if check else np.zeros(0, np.int64)
        columns, lines = _core.thinned(row, rows), _core.thinned(rows, row)
        checked_labels = np.zeros(picks.size, np.int16)
        thin = np.zeros((lines.size, columns.size), np.int16)
        counts = np.zeros(2**15 + 1, np.int64)
        settled, periods, longest, moving = 0, 0, -1, 0
        texture = _core.TextureSum(row, rows)
        before = np.zeros((0, row), np.int16)
        for at, cells in self._blocks(store, moves):
            settle = cells["settle_periods"][cells["settle_periods"] >= 0]
            settled += settle.size
            periods += int(settle.sum())
            longest = max(longest, int(settle.max(initial=-1)))
            moving += int(np.sum((cells["label"] == 0) & ~self.starts.at_rest(at)))
            label = cells["label"].reshape(-1, row)
            counts += np.bincount(label.reshape(-1) + 1, minlength=counts.size)
            mine = (picks >= at.start * row) & (picks < at.stop * row)
            checked_labels[mine] = label.reshape(-1)[picks[mine] - at.start * row]
            if grid:
                in_block = (lines >= at.start) & (lines < at.stop)
                thin[in_block] = label[lines[in_block] - at.start][:, columns]
                # A part of a texture ends with the first row of the next one.
                if before.size:
                    texture.add(np.concatenate([before, label[:1]]).reshape(-1))
                before = label
        if grid:
            texture.add(before.reshape(-1))
        texture_total = texture.total() if grid else _core.Texture.without_cells(labelled)
        measures = {name: getattr(texture_total, name) for name in _TEXTURE}
        with core_errors():
            if check:
                reliable = plan.reliability(checked_labels)
                measures |= {name: getattr(reliable, name) for name in _RELIABILITY}
                near = plan.uncertainty(thin.reshape(-1), columns.size) if grid else None
                if near is not None:
                    measures |= {"eps": near.eps, "uncertain": near.uncertain, "tried": near.tried}
        return pack(
            counts=counts[: 1 + max(2, np.flatnonzero(counts).max())],
            mean_settle=periods / settled if settled else -1.0,
            longest_settle=longest,
            moving=moving,
            **{name: value for name, value in measures.items() if value is not None},
        )

    def _final(self, store: Store, moves: list[Labels]) -> Cells:
        """Return the cells of the map with the last numbers of the attractors."""
        if self.tiles == 1:
            return self._merged(store, moves, 0)
        cells: Cells = {}
        for tile in range(self.tiles):
            for name, values in self._merged(store, moves, tile).items():
                if name not in cells:
                    cells[name] = np.empty(self.starts.shape, values.dtype)
                cells[name][self.rows(tile)] = values
        return cells
