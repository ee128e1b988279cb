"""Lifetimes of transient chaos over draws of the parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendmap.analysis.draws.sample import interval
from pendmap.analysis.draws.summary import draws_line

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr

    from pendmap.analysis.draws.sample import Draws, Progress
    from pendmap.model import Pendulum, Rig


_KEYS = ("mean_periods", "stderr", "transient_chaos", "persistent")


def lifetime_over(
    dataset: xr.Dataset,
    draws: Draws,
    run: Callable[[Pendulum | Rig, Progress | None], xr.Dataset],
    progress: Progress | None,
) -> xr.Dataset:
    """Return a lifetime with what it becomes over draws of the parameters, from the same starts.

    Parameters
    ----------
    dataset : xarray.Dataset
        The lifetime of the model's own values.
    draws : Draws
        The models, D.
    run : callable
        Measures the lifetime of one of them.
    progress : callable, optional
        As of :func:`pendmap.lifetime`; the measurement of the own values is one more.

    Returns
    -------
    xarray.Dataset
        The lifetime with ``drawn_mean_periods`` and ``drawn_stderr`` (D), nan without transient
        chaos, ``drawn_persistent`` (D) and ``drawn`` (D, parameter). Attributes
        ``mean_periods_low`` and ``mean_periods_high``, the 95 % interval over the draws, which
        holds the error of counting too; ``transient_share`` and ``persistent_share``.
    """
    rows = [
        [float(one.attrs[key]) for key in _KEYS]
        for one in (run(model, report) for model, report in draws.each(progress))
    ]
    mean, error, transient, persistent = np.array(rows).T
    _, _, low, high = interval(mean)
    found = dataset.assign(
        {
            "drawn_mean_periods": ("draw", mean),
            "drawn_stderr": ("draw", error),
            "drawn_persistent": ("draw", persistent.astype(np.int8)),
            **draws.variables,
        }
    )
    found.attrs = {
        **dataset.attrs,
        **draws.attributes,
        "mean_periods_low": float(low),
        "mean_periods_high": float(high),
        "transient_share": float(transient.mean()),
        "persistent_share": float(persistent.mean()),
    }
    found.attrs["summary"] = "\n".join([dataset.attrs["summary"], *_said(found)])
    return found


def _said(found: xr.Dataset) -> list[str]:
    a = found.attrs
    lines = [draws_line(found)]
    if a["transient_share"]:
        lines.append(
            f"Mean lifetime: 95 % of the draws in [{a['mean_periods_low']:.4g}, "
            f"{a['mean_periods_high']:.4g}] periods."
        )
    lines.append(
        f"{100 * a['transient_share']:.3g} % of the draws have transient chaos; in "
        f"{100 * a['persistent_share']:.3g} % chaos persists."
    )
    return lines
