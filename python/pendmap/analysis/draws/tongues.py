"""Critical curves over draws of the parameters: the band in which each lies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.analysis.draws.sample import interval
from pendmap.analysis.draws.summary import draws_line

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap.analysis.draws.sample import Draws, Progress
    from pendmap.model import Pendulum, Rig

    Floats = NDArray[np.float64]


_TABLES: Final = (("critical", ""), ("inverted", "inverted_"))
"""Tables of critical amplitudes, and the beginnings of the names of their variables."""


def tongues_over(
    dataset: xr.Dataset,
    draws: Draws,
    run: Callable[[Pendulum | Rig, Progress | None], xr.Dataset],
    progress: Progress | None,
) -> xr.Dataset:
    """Return critical curves with the bands in which they lie over draws of the parameters.

    At each frequency ``Omega/w0`` the critical amplitudes of one multiplier are counted from the
    lowest, and each is found again by its number.

    Parameters
    ----------
    dataset : xarray.Dataset
        The curves of the model's own values, K critical amplitudes.
    draws : Draws
        The models, D.
    run : callable
        Finds the curves of one of them at the same frequencies.
    progress : callable, optional
        As of :func:`pendmap.tongues`; the curves of the own values are one more.

    Returns
    -------
    xarray.Dataset
        The curves with ``drawn_p`` (K, D), nan where a draw has no such amplitude, ``p_low`` and
        ``p_high``, the 95 % interval over the draws, and ``exists``, the share of the draws that
        have it; the same of inverted rest with the beginning ``inverted_``; ``drawn``
        (D, parameter).
    """
    columns: dict[str, list[Floats]] = {table: [] for table, _ in _TABLES}
    for model, report in draws.each(progress):
        one = run(model, report)
        for table, prefix in _TABLES:
            theirs = _numbered(one, prefix)
            mine = _numbered(dataset, prefix)
            columns[table].append(np.array([theirs.get(key, np.nan) for key in mine], dtype=float))
    found = dataset.assign(draws.variables)
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
    found.attrs = {**dataset.attrs, **draws.attributes}
    found.attrs["summary"] = "\n".join([dataset.attrs["summary"], *_said(found)])
    return found


def _numbered(dataset: xr.Dataset, prefix: str) -> dict[tuple[int, int, int], float]:
    """Return critical amplitudes by place of the frequency, multiplier and number."""
    seen: dict[tuple[int, int], int] = {}
    numbered = {}
    for index, multiplier, p in zip(
        *(dataset[f"{prefix}{name}"].values for name in ("index", "multiplier", "p")), strict=True
    ):
        which = (int(index), int(multiplier))
        seen[which] = seen.get(which, -1) + 1
        numbered[*which, seen[which]] = float(p)
    return numbered


def _said(found: xr.Dataset) -> list[str]:
    lines = [draws_line(found)]
    p, low, high = (found[name].values for name in ("p", "p_low", "p_high"))
    asked = found["asked"].values.astype(bool)[found["index"].values]
    if asked.any():
        k = int(np.argmin(np.where(asked, p, np.inf)))
        omega = float(found["omega"].values[found["index"].values[k]])
        lines.append(
            f"The lowest critical amplitude, p = {p[k]:.6g} at omega = {omega:.6g}: 95 % of the "
            f"draws in [{low[k]:.6g}, {high[k]:.6g}]."
        )
    return lines
