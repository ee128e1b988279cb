"""Critical curves over draws of the parameters: the 95 % band of each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.draws import drawn_field, interval
from pendmap.analysis.result import rows

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.analysis.draws import Draws, Run
    from pendmap.signal import Floats


_TABLES: Final = (("critical", ""), ("inverted", "inverted_"))
"""Tables of critical amplitudes, and the prefixes of the names of their variables."""


def tongues_over(dataset: xr.Dataset, draws: Draws, run: Run) -> xr.Dataset:
    """Return K critical amplitudes with their 95 % bands over D draws.

    At each frequency ``Omega/w0`` the critical amplitudes of one multiplier are counted from the
    lowest, and matched by this number. Adds ``drawn_p`` (K, D), nan where a draw has no such
    amplitude, ``p_low`` and ``p_high``, the 95 % interval over the draws, and ``exists``, the share
    of the draws that have it; the same for inverted rest with the prefix ``inverted_``; ``drawn``
    (D, parameter).
    """
    columns: dict[str, list[Floats]] = {table: [] for table, _ in _TABLES}
    for one in draws.each(run):
        for table, prefix in _TABLES:
            theirs = _numbered(one, prefix)
            mine = _numbered(dataset, prefix)
            columns[table].append(np.array([theirs.get(key, np.nan) for key in mine], dtype=float))
    found = dataset
    for table, prefix in _TABLES:
        p = np.array(columns[table]).T
        _, _, low, high = interval(p)
        found = found.assign(
            {
                f"{prefix}drawn_p": ((table, "draw"), p),
                f"{prefix}p_low": (table, low),
                f"{prefix}p_high": (table, high),
                f"{prefix}exists": (table, np.isfinite(p).mean(axis=1)),
            }
        )
    return draws.complete(found, _lowest(found))


@drawn_field
def drawn_tongues(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the draws of critical curves for the JSON object."""
    asked = dataset["asked"].values.astype(bool)
    found = {}
    for prefix, key in (("", "curves"), ("inverted_", "inverted")):
        names = ("index", "multiplier", "p", "p_low", "p_high", "exists")
        found[key] = [
            {
                "omega": float(dataset["omega"].values[index]),
                "multiplier": multiplier,
                "p": p,
                "ci95": [low, high],
                "exists": exists,
            }
            for index, multiplier, p, low, high, exists in rows(
                dataset, *(f"{prefix}{name}" for name in names)
            )
            if asked[index]
        ]
    return found


def _numbered(dataset: xr.Dataset, prefix: str) -> dict[tuple[int, int, int], float]:
    """Return critical amplitudes by frequency index, multiplier and number."""
    seen: dict[tuple[int, int], int] = {}
    numbered = {}
    names = (f"{prefix}{name}" for name in ("index", "multiplier", "p"))
    for index, multiplier, p in rows(dataset, *names):
        which = index, multiplier
        seen[which] = seen.get(which, -1) + 1
        numbered[*which, seen[which]] = p
    return numbered


def _lowest(found: xr.Dataset) -> list[str]:
    p, low, high = (found[name].values for name in ("p", "p_low", "p_high"))
    asked = found["asked"].values.astype(bool)[found["index"].values]
    if not asked.any():
        return []
    k = int(np.argmin(np.where(asked, p, np.inf)))
    omega = float(found["omega"].values[found["index"].values[k]])
    line = (
        f"The lowest critical amplitude, p = {p[k]:.6g} at omega = {omega:.6g}: 95 % of the "
        f"draws in [{low[k]:.6g}, {high[k]:.6g}]."
    )
    return [line]
