"""Maps over two parameters over draws of the others: the probability of each regime."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.analysis.draws import count_sure_cells, drawn_field, outcomes
from pendmap.analysis.result import rows

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.analysis.draws import Draws, Run


_LISTED = 10  # Largest number of regimes in a summary
_SHARES = ("outcome_kinds", "share_mean", "share_low", "share_high")  # Variables over the outcomes


def regimes_over(dataset: xr.Dataset, draws: Draws, run: Run) -> xr.Dataset:
    """Return a map of M x N cells with the regimes of D draws of the other parameters.

    Adds, over ``outcome``, all regimes: ``outcome_kinds`` (as ``regime_kinds``), ``probability``
    (outcome, M, N), ``drawn_share`` (outcome, D), ``share_mean``, ``share_low`` and ``share_high``
    (the 95 % interval over the draws); over the cells ``certainty``, the probability of the most
    likely regime; ``drawn`` (D, parameter). Attribute ``sure_cells``: the share of the cells with a
    certainty of 95 % or more.
    """
    dims, shape = dataset["regime"].dims, dataset["regime"].shape
    counts: dict[str, np.ndarray] = {}
    shares: list[dict[str, float]] = []
    for one in draws.each(run):
        own = [str(text) for text in one["regime_kinds"].values]
        shares.append(dict(zip(own, one["regime_share"].values.tolist(), strict=True)))
        for k, text in enumerate(own):
            counts.setdefault(text, np.zeros(shape, np.uint16))[one["regime"].values == k] += 1
    share = np.array([[one.get(text, 0.0) for one in shares] for text in counts])
    order = np.argsort(-share.mean(axis=1), kind="stable")
    texts = np.array(list(counts), dtype=str)[order]
    probability = np.stack(list(counts.values()))[order].astype(np.float32) / len(draws)
    found = dataset.assign(outcome_kinds=("outcome", texts))
    found = found.assign(outcomes(dims, probability, share[order]))
    return draws.complete(found, _summary(found))


@drawn_field
def drawn_regimes(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the draws of a map over two parameters for the JSON object."""
    regimes = [
        {"kinds": json.loads(text), "share": mean, "ci95": [low, high]}
        for text, mean, low, high in rows(dataset, *_SHARES)
    ]
    return {"regimes": regimes, "sure_cells": dataset.attrs["sure_cells"]}


def _summary(found: xr.Dataset) -> list[str]:
    lines = []
    every = list(rows(found, *_SHARES))
    for kinds, mean, low, high in every[:_LISTED]:
        text = kinds.strip("[]").replace('"', "")
        lines.append(
            f"{text}: {100 * mean:.3g} % of the cells, 95 % of the draws in "
            f"[{100 * low:.3g}, {100 * high:.3g}] %."
        )
    if len(every) > _LISTED:
        lines.append(f"{len(every) - _LISTED} more regimes are in the result.")
    return [*lines, count_sure_cells(found, "a regime")]
