"""Audit of an adaptive map: filled cells drawn at random, and what they tell of the others."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy.special import betaincinv

from pendmap.analysis.result import Field, Found
from pendmap.files import facts
from pendmap.formatting import percent

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap.signal import Indices

FILLED, COMPUTED, RIGHT, WRONG = range(4)
HOW: Final = {
    FILLED: "filled",
    COMPUTED: "computed",
    RIGHT: "audited",
    WRONG: "audited_where_filled_wrong",
}
"""How the label of a cell was found."""
NO_TURNS: Final = int(np.iinfo(np.int32).min)  # Net turns of a cell that was not computed
NEVER: Final = -1  # Settling time of a cell that was not captured, or not computed
MOST_FRACTAL: Final = 0.5  # Share of blocks computed whole above which all cells are computed
_AUDIT: Final = 10_000  # Number of cells drawn for the audit, one in 32 at most


def _told(dataset: xr.Dataset) -> dict[str, Any] | None:
    """Return what an adaptive map computed and audited for the JSON object."""
    a = facts(dataset)
    if "adaptive" not in a:
        return None
    low, high = a["label_error_low"], a["label_error_high"]
    return {
        "computed": a["computed_share"],
        "fractal_blocks": a.get("fractal_blocks"),
        "audited": a["audited"],
        "audited_wrong": a["audited_wrong"],
        "label_error": {"value": a["label_error"], "ci95": [low, high]},
    }


FIELDS: Final = (
    Field("adaptive", "", "cells computed, and the error of those filled", None, read=_told),
    Found("computed_share", "1", "share of the cells that were computed", None, json=False),
    Found(
        "fractal_blocks",
        "1",
        "share of blocks tried whose quarters all have several labels on their rims; above one "
        "half all cells are computed",
        None,
        json=False,
    ),
    Found("audited", "1", "filled cells drawn at random and computed", None, json=False),
    Found("audited_wrong", "1", "those filled with a wrong label", None, json=False),
    Found("label_error", "1", "share of cells with a wrong label, by the audit", None, json=False),
    Found("label_error_low", "1", "lower end of its 95 % interval", None, json=False),
    Found("label_error_high", "1", "upper end of its 95 % interval", None, json=False),
)
"""Facts of an adaptive map."""
FACTS: Final = tuple(field.name for field in FIELDS)


def drawn_cells(cells: int, seed: int) -> Indices:
    """Return the indices of the cells of a grid that are audited if they are filled, rising."""
    draw = np.random.default_rng([seed, 1])
    return np.unique(draw.integers(cells, size=min(_AUDIT, cells // 32)))


def audited(label: NDArray[np.int16], filled: NDArray[np.int16]) -> NDArray[np.int8]:
    """Return how cells were found whose computed and filled labels these are."""
    return np.where(label == filled, RIGHT, WRONG).astype(np.int8)


def audit_again(
    cells: Mapping[str, NDArray[Any]],
    moves: Iterable[NDArray[np.int16]],
    record: Mapping[str, NDArray[Any]],
) -> None:
    """Compare audited cells of a tile anew, after later steps; ``moves`` have renamed labels."""
    if "audited" in record:
        filled = record["filled"]
        for moved in moves:
            filled = moved[filled - 1]
        cells["computed"][record["audited"]] = audited(cells["label"][record["audited"]], filled)


class Tally:
    """Counts of the cells of a map: how they were found, and when they settled."""

    def __init__(self) -> None:
        self._cells = np.zeros(len(HOW), np.int64)
        self._settled = np.zeros(len(HOW), np.int64)
        self._periods = np.zeros(len(HOW), np.int64)
        self.longest = NEVER
        """Longest settling time; -1 if no start settled."""

    def add(self, cells: Mapping[str, NDArray[Any]]) -> None:
        """Add some cells; without ``computed`` all have been."""
        settle, how = cells["settle_periods"], cells.get("computed")
        parts = {COMPUTED: settle}
        if how is not None:
            known = how != FILLED
            self._cells[FILLED] += how.size - np.count_nonzero(known)
            settle, how = settle[known], how[known]
            parts = {k: settle[how == k] for k in (COMPUTED, RIGHT, WRONG)}
        for k, own in parts.items():
            settled = own[own >= 0]
            self._cells[k] += own.size
            self._settled[k] += settled.size
            self._periods[k] += int(settled.sum())
            self.longest = max(self.longest, int(settled.max(initial=NEVER)))

    @property
    def mean_settle(self) -> float:
        """Mean settling time, where audited cells stand for the filled ones; -1 if none settled."""
        rest, drawn = self._cells[FILLED], self._cells[RIGHT:].sum()
        weight = 1 + rest / drawn if rest and drawn else 1
        number, total = (
            own[COMPUTED].item() + weight * own[RIGHT:].sum().item()
            for own in (self._settled, self._periods)
        )
        return float(total / number) if number else -1.0

    def facts(self, record: Mapping[str, NDArray[Any]]) -> dict[str, float]:
        """Return what was tried and computed, and the share of wrong labels with its 95 % interval.

        The interval is exact for a binomial count (Clopper & Pearson 1934, Biometrika 26, 404).
        """
        drawn, wrong = self._cells[RIGHT:].sum().item(), self._cells[WRONG].item()
        rest = (self._cells[FILLED] / self._cells.sum()).item()
        low = betaincinv(wrong, drawn - wrong + 1, 0.025) if wrong else 0.0
        high = betaincinv(wrong + 1, drawn - wrong, 0.975) if wrong < drawn else 1.0
        return {
            "adaptive": 1,
            "computed_share": (self._cells[COMPUTED:].sum() / self._cells.sum()).item(),
            "audited": drawn,
            "audited_wrong": wrong,
            "label_error": rest * wrong / max(drawn, 1),
            "label_error_low": rest * float(low),
            "label_error_high": rest * float(high),
            **{name: record[name].item() for name in record if name in FACTS},
        }


def said(a: Mapping[str, Any]) -> list[str]:
    """Return summary lines of an adaptive map from its facts."""
    if "adaptive" not in a:
        return []
    if a["plane"] != "basins":
        return ["All cells were computed: without labels there is nothing to refine."]
    if a.get("fractal_blocks", 0) > MOST_FRACTAL:
        blocks = percent(100 * a["fractal_blocks"])
        line = (
            "The boundary is fractal everywhere at this resolution, and all cells were computed: "
            f"{blocks} of the blocks tried have several labels in each quarter."
        )
        return [line]
    share, low, high = (
        percent(100 * a[name]) for name in ("computed_share", "label_error_low", "label_error_high")
    )
    if a["computed_share"] == 1:
        return ["All cells were computed: each is at a boundary."]
    lines = [f"{share} of the cells were computed; the others are inside blocks of one label."]
    if a["audited"]:
        lines.append(
            f"Of {a['audited']} of these, drawn at random and computed, {a['audited_wrong']} had "
            f"another label: {low} to {high} of the map's labels are wrong (95 %)."
        )
    return lines
