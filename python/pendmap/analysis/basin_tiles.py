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
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pendmap.engine import Store, Work
    from pendmap.model import Pendulum
    from pendmap.signal import Floats, Indices

    Axes = tuple[tuple[float, float, int], tuple[float, float, int]]
    Labels = NDArray[np.int16]
    Cells = dict[str, NDArray[Any]]
    Progress = Callable[[int, int], object]

TILE: Final = 2**20
"""Largest number of starts of a tile: 0.3 CPU seconds of a smooth map, 5 of a chaotic one."""
_LEAST_TILE: Final = 2**18
_TILES: Final = 64  # Least number of tiles of a map of larger ones: workers end together
_BOX: Final = 5  # Tiles begin with a row of boxes of the basin entropy
_SAMPLE: Final = 256  # Largest number of undecided starts from which a further search begins
_CELLS: Final[tuple[str, ...]] = ("label", "settle_periods", "net_turns")
_NOTHING: Final = np.zeros(0, np.int64)
_NO_STATES: Final = np.zeros(0)
_BYTES: Final = 32  # Memory of a start during the computation
_NOT_CHECKED: Final = SimpleNamespace(
    unreliable=0.0, unreliable_half_step=0.0, unreliable_mirror=None, labels_sampled=0
)


def sources(
    plan: _core.BasinPlan,
    texture: _core.Texture,
    checked: _core.Reliability | None,
    counts: NDArray[np.int64],
    work: int,
) -> tuple[Any, ...]:
    """Return what has the measures of a map by their names; ``counts`` are of labels from -1."""
    failed, undecided = (counts[:2] / counts.sum()).tolist()
    shares = SimpleNamespace(
        failed=failed,
        undecided=1.0 if plan.plane == "conservative" else undecided,
        mean_periods=work / int(counts.sum()),
    )
    return shares, plan, texture, checked or _NOT_CHECKED


class Starts:
    """The starts of a map: a grid by its axes, or a list of states; without dimensions."""

    def __init__(
        self, axes: Axes | None, theta: Floats = _NO_STATES, velocity: Floats = _NO_STATES
    ) -> None:
        self.axes, self.theta, self.velocity = axes, theta, velocity
        self.shape: tuple[int, ...] = self.theta.shape if axes is None else (axes[1][2], axes[0][2])
        self.dims = ("start",) if axes is None else ("velocity", "theta")
        self.row = math.prod(self.shape[1:])
        """Number of starts in a row."""
        cells = min(TILE, max(_LEAST_TILE, math.prod(self.shape) // _TILES))
        self.height = min(_BOX * -(-cells // (_BOX * self.row)), self.shape[0])
        """Number of rows of a tile, of whole boxes."""

    def of_rows(self, rows: slice) -> Any:  # noqa: ANN401 (of two kinds)
        """Return the starts that a tile needs: all axes of a grid, the states of a list."""
        return self.axes or (self.theta[rows], self.velocity[rows])


@dataclasses.dataclass(frozen=True)
class BasinTiles:
    """The job of a basin map."""

    pendulum: Pendulum
    starts: Starts
    choices: _core._Choices
    rate: float = 1.0  # Exponents of the model for one without dimensions
    threads: int = 1  # Threads of a tile; the search and the checks have those of the choices
    at_once: int = 1  # Number of tiles that this process computes at once

    @property
    def tiles(self) -> int:
        """Number of tiles."""
        return -(-self.starts.shape[0] // self.starts.height)

    def rows(self, tile: int) -> slice:
        """Return the rows of a tile."""
        height = self.starts.height
        return slice(tile * height, min((tile + 1) * height, self.starts.shape[0]))

    def _plan(
        self, state: bytes | None = None, progress: Progress | None = None
    ) -> _core.BasinPlan:
        """Return the plan of a record for all starts, or search for attractors."""
        starts = self.starts.of_rows(slice(None))
        with core_errors():
            return _core.BasinPlan(self.pendulum, starts, self.choices, state, progress)

    # ---- tiles

    def inputs(self, store: Store, step: str, tile: int) -> Indices | None:
        """Return the indices of the undecided starts of a tile, None in the first step."""
        if step == "label":
            return None
        return self._undecided(store, int(step.removeprefix("again-")), tile)

    def tile(
        self,
        step: str,  # noqa: ARG002 (the inputs tell)
        state: bytes,
        tile: int,
        inputs: Indices | None,
        progress: Any = None,  # noqa: ANN401
    ) -> Cells:
        """Label the starts of a tile, or its undecided ones again."""
        rows = self.rows(tile)
        choices: _core._Choices = {**self.choices, "threads": self.threads}
        with core_errors():
            starts = self.starts.of_rows(rows)
            plan = _core.BasinPlan(self.pendulum, starts, choices, state)
        first, last = rows.start * self.starts.row, rows.stop * self.starts.row
        before = 0 if self.starts.axes else first  # starts that the plan does not have
        if inputs is None:
            labelled = plan.label(first - before, last - before, progress)
        else:
            labelled = plan.label_again(inputs - before, progress)
        arrays = labelled.label, labelled.settle, labelled.turns
        cells: Cells = dict(zip(_CELLS, arrays, strict=True))
        if inputs is not None:
            return pack(picks=inputs, work=labelled.work, **cells)
        if labelled.finite_time_exponent is not None:
            exponent = labelled.finite_time_exponent * np.float32(self.rate)
            cells["finite_time_exponent"] = exponent
        undecided = np.count_nonzero(labelled.label == 0)
        return pack(work=labelled.work, undecided=undecided, **cells)

    def _undecided(self, store: Store, again: int, tile: int) -> Indices:
        """Return the indices of the starts of a tile that are labelled in a step ``again``."""
        if again == 1:
            labels = unpack(store.get(f"label/{tile}") or {})["label"]
            picks: Indices = np.arange(labels.size) + self.rows(tile).start * self.starts.row
        else:
            record = store.get(f"again-{again - 1}/{tile}")
            arrays = {"picks": _NOTHING, "label": _NOTHING} if record is None else unpack(record)
            labels, picks = arrays["label"], arrays["picks"]
        undecided: Indices = picks[labels == 0]
        return undecided

    # ---- the whole

    def run(self, work: Work, *, check: bool) -> SimpleNamespace:
        """Compute what is missing; return attractors and measures by the names of the schema."""
        store = work.store
        _core.reckon("starts", math.prod(self.starts.shape), _BYTES)
        first = work.once("plan-0", lambda: self._plan(progress=work.progress).state)
        plan = self._plan(first)
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
            plan = self._plan(work.once(f"plan-{again}", further["state"].tobytes))
            tiles = np.flatnonzero(undecided).tolist()
            for tile, record in work.each(f"again-{again}", f"plan-{again}", tiles):
                arrays = unpack(record)
                undecided[tile] = np.count_nonzero(arrays["label"] == 0)
                periods += int(arrays["work"])
        whole = self._whole(plan, store, moves, check=labelled and check)
        attractors, last = plan.finish(np.ascontiguousarray(whole.counts[2:]))
        cells = [self._merged(store, [*moves, last], tile) for tile in range(self.tiles)]
        return SimpleNamespace(
            **vars(whole),
            plan=plan,
            sources=(whole, *sources(plan, whole.texture, whole.checked, whole.counts, periods)),
            attractors=attractors,
            cells={name: np.concatenate([one[name] for one in cells]) for name in cells[0]},
        )

    def _search(self, plan: _core.BasinPlan, store: Store, undecided: Indices, again: int) -> Cells:
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
        """Return the cells of a tile; ``moves`` are the new numbers after each step ``again``."""
        arrays, shape = unpack(store.get(f"label/{tile}") or {}), (-1, *self.starts.shape[1:])
        names = [name for name in (*_CELLS, "finite_time_exponent") if name in arrays]
        cells: Cells = {name: arrays[name].reshape(shape).copy() for name in names}
        flat = {name: values.reshape(-1) for name, values in cells.items()}
        for k, moved in enumerate(moves):
            label = flat["label"]
            label[label > 0] = moved[label[label > 0] - 1]
            record = store.get(f"again-{k + 1}/{tile}")
            if record is not None:
                arrays = unpack(record)
                at = arrays["picks"] - self.rows(tile).start * self.starts.row
                for name in _CELLS:
                    flat[name][at] = arrays[name]
        return cells

    def _whole(
        self, plan: _core.BasinPlan, store: Store, moves: list[Labels], *, check: bool
    ) -> SimpleNamespace:
        """Return what the whole map tells."""
        rows, row = self.starts.shape[0], self.starts.row
        grid = plan.plane == "basins" and self.starts.axes is not None
        picks = plan.checked_starts() if check else _NOTHING
        columns, lines = _core.thinned(row, rows), _core.thinned(rows, row)
        checked_labels = np.zeros(picks.size, np.int16)
        thin = np.zeros((lines.size, columns.size), np.int16)
        counts = np.zeros(2**15 + 1, np.int64)
        settled, periods, longest = 0, 0, -1
        texture = _core.TextureSum(row, rows)
        before = np.zeros((0, row), np.int16)
        for tile in range(self.tiles):
            cells, at = self._merged(store, moves, tile), self.rows(tile)
            settle = cells["settle_periods"][cells["settle_periods"] >= 0]
            settled += settle.size
            periods += int(settle.sum())
            longest = max(longest, int(settle.max(initial=-1)))
            label = cells["label"].reshape(-1, row)
            counts += np.bincount(label.reshape(-1) + 1, minlength=counts.size)
            mine = (picks >= at.start * row) & (picks < at.stop * row)
            checked_labels[mine] = label.reshape(-1)[picks[mine] - at.start * row]
            if grid:
                in_tile = (lines >= at.start) & (lines < at.stop)
                thin[in_tile] = label[lines[in_tile] - at.start][:, columns]
                # A part of a texture ends with the first row of the next one.
                if before.size:
                    texture.add(np.concatenate([before, label[:1]]).reshape(-1))
                before = label
        if grid:
            texture.add(before.reshape(-1))
        none = _core.Texture.without_cells(plan.plane == "basins")
        with core_errors():
            checked = plan.reliability(checked_labels) if check else None
            near = plan.uncertainty(thin.reshape(-1), columns.size) if check and grid else None
        return SimpleNamespace(
            counts=counts[: 1 + max(2, np.flatnonzero(counts).max())],
            mean_settle=periods / settled if settled else -1.0,
            longest_settle=longest,
            texture=texture.total() if grid else none,
            checked=checked,
            near=near,
        )
