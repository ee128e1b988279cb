"""The torque that a model lacks, over what it was binned by."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts.diagnosis import ACCELERATION, OVER_SAID
from pendmap.render import style
from pendmap.render.gap import models

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pendmap.diagnosis import Discrepancy

Z95: Final = 1.959963984540054


def shown_over(found: Discrepancy) -> list[str]:
    """Return what there is a torque over: a free decay alone has no drive's phase."""
    both = (found.torque_before, found.torque_after)
    return [name for name in OVER_SAID if any(torque.rows.get(name) for torque in both)]


def draw_torque(axes: Axes, found: Discrepancy, over: str) -> None:
    """Draw the torque that both models lack over one of these, with bands of 95 %."""
    rows: list[dict[str, Any]] = []
    torques = (found.torque_before, found.torque_after)
    for (name, colour), torque in zip(models(found), torques, strict=False):
        own = torque.rows.get(over, [])
        rows += own
        if not own:
            continue
        edges = np.array([own[0]["from"], *(row["to"] for row in own)])
        value, error = (np.array([row[key] for row in own]) for key in ("torque", "stderr"))
        low, high = (np.append(v, v[-1]) for v in (value - Z95 * error, value + Z95 * error))
        axes.fill_between(edges, low, high, step="post", color=colour, alpha=0.25, lw=0)
        axes.stairs(value, edges, baseline=None, color=colour, lw=1.3, label=name)
    axes.axhline(0, color=style.QUIET, lw=0.7)
    if rows:
        axes.set_xlim(min(row["from"] for row in rows), max(row["to"] for row in rows))
    axes.set_xlabel(OVER_SAID[over])
    along = rows and rows[0]["along_motion"]
    said = "torque along\nthe motion" if along else "torque"
    axes.set_ylabel(f"{said} ({ACCELERATION})", labelpad=2)
