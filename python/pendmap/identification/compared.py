"""What a comparison of a model with records shows, as JSON and as text."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

from pendmap.identification import forced_said
from pendmap.records.summary import doubts, doubts_said, findings_said

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.identification.compare import Comparison, RunComparison

__all__ = ["as_json", "as_text", "tables"]

FITS: Final = 1.1
"""Rms over noise up to which a model is said to describe a record: the noise is known to a few
percent."""


def as_json(comparison: Comparison) -> dict[str, Any]:
    """Return the JSON object of ``pendmap compare``."""
    return {
        "experiment": str(comparison.experiment.path),
        "doubts": doubts(comparison.experiment, *(one.run for one in comparison.every)),
        "runs": [
            *(_run(run) for run in comparison.runs),
            *(forced_said.as_json(run) for run in comparison.forced),
        ],
        "left_out": [{"name": name, "why": why} for name, why in comparison.left_out],
        "findings": [found.text for found in comparison.experiment.findings],
    }


def _run(one: RunComparison) -> dict[str, Any]:
    errors = one.errors
    return {
        "name": one.run.name,
        "kind": one.run.kind,
        "hold_out": one.run.hold_out,
        "samples": int(one.run.trusted.sum()),
        "noise": one.sigma,
        "rms": one.rms,
        "start": {"theta": one.start[0], "velocity": one.start[1]},
        "period_rms_percent": None if errors is None else errors.period_rms,
        "peak_rms_percent": None if errors is None else errors.peak_rms,
        "table1": [
            {
                "what": row.what,
                "asked": row.asked,
                "measured": row.measured,
                "error_percent": next(iter(row.errors.values()), None),
            }
            for row in one.table.rows
        ],
        "table1_left_out": one.table.left_out or next(iter(one.table.lost.values()), None),
        "periods": _pairs(errors and errors.period_time, errors and errors.period_error),
        "peaks": _pairs(errors and errors.peak, errors and errors.peak_error),
        "findings": [found.text for found in one.run.findings],
    }


def _pairs(places: Any, errors: Any) -> list[dict[str, float | None]]:  # noqa: ANN401 (arrays or none)
    if places is None:
        return []
    return [
        {"at": float(at), "error_percent": float(error) if math.isfinite(error) else None}
        for at, error in zip(places, errors, strict=True)
    ]


def tables(comparison: Comparison) -> list[tuple[list[str], list[list[str]]]]:
    """Return heads and rows of the tables of free decays and of forced runs."""
    both = [_decays(comparison), forced_said.table(comparison.forced)]
    return [table for table in both if table[1]]


def _decays(comparison: Comparison) -> tuple[list[str], list[list[str]]]:
    rows = []
    for one in comparison.runs:
        errors = one.errors
        rows.append(
            [
                one.run.name + (" (held out)" if one.run.hold_out else ""),
                f"{one.rms:.4g}",
                f"{one.sigma:.3g}",
                f"{one.rms / one.sigma:.3g}",
                "" if errors is None else _percent(errors.period_rms),
                "" if errors is None else _percent(errors.peak_rms),
            ]
        )
    head = ["run", "rms (rad)", "noise (rad)", "rms / noise", "periods, rms", "peaks, rms"]
    return head, rows


def _percent(value: float) -> str:
    return f"{value:.3g} %" if math.isfinite(value) else ""


def as_text(comparison: Comparison) -> Iterator[str]:
    """Yield the lines beside the table: table 1, whether the model fits, what was found.

    Doubts about a unit come first.
    """
    runs = [one.run for one in comparison.every]
    yield from doubts_said(comparison.experiment, *runs)
    for one in comparison.runs:
        for row in one.table.rows:
            unit = "s" if row.what == "period" else "rad"
            error = next(iter(row.errors.values()), math.nan)
            said = "the model rests by then" if math.isnan(error) else f"error {error:.3g} %"
            yield f"{one.run.name}: {row.what} of {row.measured:.4g} {unit}: {said}"
        if one.table.left_out:
            yield f"{one.run.name}: {one.table.left_out}"
        for reason in one.table.lost.values():
            yield f"{one.run.name}: periods and peaks are not compared: {reason}"
        if one.rms > FITS * one.sigma:
            yield (
                f"{one.run.name}: the residual is {one.rms / one.sigma:.3g} times the noise: "
                "something is missing in the model"
            )
    for forced in comparison.forced:
        yield from forced_said.lines(forced, FITS)
    for name, why in comparison.left_out:
        yield f"{name}: not compared: {why}"
    yield from findings_said(comparison.experiment, *runs)
