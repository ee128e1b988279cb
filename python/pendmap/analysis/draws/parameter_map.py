"""Maps over two parameters over draws of the others: how probable each regime is in each cell."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendmap.analysis.draws.basins import SURE
from pendmap.analysis.draws.sample import interval
from pendmap.analysis.draws.summary import draws_line

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr

    from pendmap.analysis.draws.sample import Draws, Progress
    from pendmap.model import Pendulum, Rig


_LISTED = 10


def regimes_over(
    dataset: xr.Dataset,
    draws: Draws,
    run: Callable[[Pendulum | Rig, Progress | None], xr.Dataset],
    progress: Progress | None,
) -> xr.Dataset:
    """Return a map over two parameters with what it becomes over draws of the others.

    Parameters
    ----------
    dataset : xarray.Dataset
        The map of the model's own values, M x N cells.
    draws : Draws
        The models, D.
    run : callable
        Computes the map of one of them over the same cells.
    progress : callable, optional
        As of :func:`pendmap.parameter_map`; the map of the own values is one more.

    Returns
    -------
    xarray.Dataset
        The map with, over ``outcome``, all regimes: ``outcome_kinds`` (as ``regime_kinds``),
        ``probability`` (outcome, M, N), ``drawn_share`` (outcome, D), ``share_mean``,
        ``share_low`` and ``share_high`` (the 95 % interval over the draws); over the cells
        ``certainty``, the probability of the most likely regime; ``drawn`` (D, parameter).
        Attribute ``sure_cells``: the share of the cells with a certainty of 95 % or more.
    """
    dims, shape = dataset["regime"].dims, dataset["regime"].shape
    counts: dict[str, np.ndarray] = {}
    shares: list[dict[str, float]] = []
    for model, report in draws.each(progress):
        one = run(model, report)
        own = [str(text) for text in one["regime_kinds"].values]
        shares.append(dict(zip(own, one["regime_share"].values.tolist(), strict=True)))
        for k, text in enumerate(own):
            counts.setdefault(text, np.zeros(shape, np.uint16))[one["regime"].values == k] += 1
    share = np.array([[one.get(text, 0.0) for one in shares] for text in counts])
    mean, _, low, high = interval(share)
    order = np.argsort(-mean, kind="stable")
    texts = np.array(list(counts), dtype=str)[order]
    probability = np.stack(list(counts.values()))[order].astype(np.float32) / len(draws)
    found = dataset.assign(
        {
            "outcome_kinds": ("outcome", texts),
            "probability": (("outcome", *dims), probability, {"units": "1"}),
            "certainty": (dims, probability.max(axis=0), {"units": "1"}),
            "drawn_share": (("outcome", "draw"), share[order], {"units": "1"}),
            "share_mean": ("outcome", mean[order]),
            "share_low": ("outcome", low[order]),
            "share_high": ("outcome", high[order]),
            **draws.variables,
        }
    )
    sure = float((found["certainty"].values >= SURE).mean())
    found.attrs = {**dataset.attrs, **draws.attributes, "sure_cells": sure}
    found.attrs["summary"] = "\n".join([dataset.attrs["summary"], *_said(found)])
    return found


def _said(found: xr.Dataset) -> list[str]:
    a = found.attrs
    lines = [draws_line(found)]
    rows = zip(*(found[f"share_{key}"].values for key in ("mean", "low", "high")), strict=True)
    texts = [str(text).strip("[]").replace('"', "") for text in found["outcome_kinds"].values]
    for text, (mean, low, high) in list(zip(texts, rows, strict=True))[:_LISTED]:
        lines.append(
            f"{text}: {100 * mean:.3g} % of the cells, 95 % of the draws in "
            f"[{100 * low:.3g}, {100 * high:.3g}] %."
        )
    if len(texts) > _LISTED:
        lines.append(f"{len(texts) - _LISTED} more regimes are in the result.")
    lines.append(
        f"{100 * a['sure_cells']:.1f} % of the cells have a regime with a probability of "
        f"{100 * SURE:g} % or more."
    )
    return lines
