"""JSON and text of a comparison of a model with a forced run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pendmap.formatting import counted, percent

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pendmap.comparison.forced import ForcedComparison, Statistic
    from pendmap.comparison.steady import Steady


def as_json(one: ForcedComparison) -> dict[str, Any]:
    """Return the JSON object of one run, with infinity for a time beyond the record's end."""
    run, start = one.run, one.start
    return {
        "name": run.name,
        "kind": run.kind,
        "hold_out": run.hold_out,
        "samples": int(run.trusted.sum()),
        "noise": one.sigma,
        "rms": one.rms,
        "windows": one.windows,
        "start": {"theta": start.theta, "velocity": start.velocity},
        "start_stderr": dict(zip(("theta", "velocity"), start.stderr, strict=True)),
        "drive": None if run.drive is None else dict(run.drive),
        "phi": None
        if one.phase is None
        else {"value": one.phase.value, "stderr": one.phase.stderr},
        "members": one.ensemble.members,
        "members_lost": one.lost,
        "spread": one.ensemble.spread,
        "statistics": [
            {
                "what": each.name,
                "unit": each.unit or "1",
                "measured": each.measured,
                "median": each.median,
                "ci95": each.ci95,
                "chance": each.chance,
            }
            for each in one.statistics
        ],
        "steady": None if one.steady is None else _steady(one.steady),
        "findings": [found.text for found in run.findings],
    }


def _steady(found: Steady) -> dict[str, Any]:
    return {
        "kind": found.measured.kind,
        "n": found.measured.n,
        "w": found.measured.w,
        "cycles": found.cycles,
        "amplitude": found.measured.amplitude,
        "model": [
            {"kind": one.cycle.kind, "n": one.cycle.n, "w": one.cycle.w, "share": one.share}
            for one in found.reached
        ],
        "rms_theta": found.rms,
        "rms_velocity": found.rms_velocity,
        "amplitude_error_percent": 100 * found.overestimate,
    }


def table(runs: Sequence[ForcedComparison]) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of the table of statistics."""
    rows = []
    for one in runs:
        name = one.run.name + (" (held out)" if one.run.hold_out else "")
        for k, each in enumerate(one.statistics):
            low, high = each.ci95
            rows.append(
                [
                    "" if k else name,
                    each.name + (f" ({each.unit})" if each.unit else ""),
                    written(each, each.measured),
                    written(each, each.median),
                    f"{written(each, low)} to {written(each, high)}",
                    f"{each.chance:.2g}",
                ]
            )
    head = ["forced run", "what", "record", "model: median", "95 % of its ensemble", "chance"]
    return head, rows


def written(of: Statistic, value: float, digits: int = 4) -> str:
    """Return a value of a statistic as text."""
    if not math.isfinite(value):
        return "not yet"
    return f"{value:.0f}" if not of.unit or abs(value) >= 10**digits else f"{value:.{digits}g}"


def lines(one: ForcedComparison, fits: float) -> Iterator[str]:
    """Yield the lines on a run's residual, steady state and improbable statistics."""
    name = one.run.name
    ratio = one.rms / one.sigma if one.sigma else math.inf
    missing = ": the model does not describe this run" if ratio > fits else ""
    yield (
        f"{name}: in {counted(one.windows, 'window')} of up to three swings the residual is "
        f"{one.rms:.3g} "
        f"rad, {ratio:.3g} times the noise{missing}"
    )
    if one.phase is not None:
        yield f"{name}: the drive's phase is not given: {one.phase.value:.4g} rad was fitted"
    if one.steady is not None:
        yield from _of_steady(name, one.steady)
    for each in one.unlike:
        unit = f" {each.unit}" if each.unit and math.isfinite(each.measured) else ""
        yield (
            f"{name}: {each.name}: {written(each, each.measured)}{unit} is improbable under the "
            f"model (p-value {each.chance:.2g})"
        )
    if one.lost:
        yield f"{name}: {one.lost} of {one.ensemble.members} members overflowed"


def _of_steady(name: str, found: Steady) -> Iterator[str]:
    ends = [
        f"{one.cycle.kind} from {percent(100 * one.share)} of the starts" for one in found.reached
    ]
    share = sum(one.share for one in found.reached)
    if share < 1 - 1e-9:
        ends.append(f"no cycle from {percent(100 * (1 - share))}")
    head = f"{name}: settles on {found.measured.kind}; the model on {', '.join(ends)}"
    if found.model is None:
        yield f"{head}: not on the measured one"
        return
    more = ""
    if math.isfinite(found.overestimate):
        more = f", in amplitude by {100 * found.overestimate:+.2g} %"
    yield (
        f"{head}. Over a cycle they differ by {found.rms:.2g} rad and {found.rms_velocity:.2g} "
        f"rad/s rms{more}"
    )
