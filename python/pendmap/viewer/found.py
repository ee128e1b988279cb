"""What was found in a record, as a page of text."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.words import counted

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pendmap.identification import Estimate, Identification, IdentificationReport

__all__ = ["page"]

UNITS: Final[Mapping[str, str]] = {
    "w0": "rad/s",
    "c_over_m": "1/s",
    "Tr": "rad/s\N{SUPERSCRIPT TWO}",
    "offset": "rad",
    "theta_r": "rad",
}
"""Units of what several methods know; parameters of effects are in SI, as they say themselves."""

COMPARED: Final = ("w0", "c_over_m", "Tr")
"""What all methods are compared by."""

DIGITS: Final = 5
"""Digits of a number whose uncertainty is not known."""


def page(report: IdentificationReport) -> str:
    """Return the tables of what was found, with intervals, and everything that was warned of."""
    return "\n".join([*_best(report), *_methods(report), *_warnings(report)])


def _best(report: IdentificationReport) -> Iterator[str]:
    try:
        best = report.best
    except InputError:
        yield from ("**No method could be applied.**", "")
        return
    yield f"## {_said(best.method)}"
    yield from ("", f"Used: {best.used}." if best.used else "", "")
    yield from ("| parameter | value | 95 % interval | unit |", "|---|---|---|---|")
    for name, each in {**best.estimates, **best.derived}.items():
        yield f"| {name} | {_value(each)} | {_interval(each)} | {UNITS.get(name, '')} |"
    yield ""
    if report.joint is not None and report.joint.fit.rms:
        fit = report.joint.fit
        noise = ", ".join(f"{reading.sigma:.3g}" for reading in report.joint.readings)
        yield (
            f"Residuals: {fit.rms:.3g} rad rms in {counted(fit.samples, 'reading')}; noise seen "
            f"without a model: {noise} rad."
        )
        yield ""


def _methods(report: IdentificationReport) -> Iterator[str]:
    yield from ("## All methods", "")
    yield "| method | w0 (rad/s) | c/m (1/s) | Tr (rad/s\N{SUPERSCRIPT TWO}) |"
    yield "|---|---|---|---|"
    for name, found in report.methods.items():
        if not found.applicable:
            yield f"| {_said(name)} | not applicable | | |"
            continue
        cells = [_with_interval(found, one) for one in COMPARED]
        yield f"| {_said(name)} | {' | '.join(cells)} |"
    yield ""


def _warnings(report: IdentificationReport) -> Iterator[str]:
    runs = report.joint.runs if report.joint is not None else (report.run,)
    found = [(name, text) for name, each in report.methods.items() for text in each.warnings]
    if found:
        yield from ("## Warnings", "")
        yield from (f"- {_said(name)}: {text}" for name, text in found)
        yield ""
    said = [(run.name, finding.text) for run in runs for finding in run.findings]
    said += [("experiment", finding.text) for finding in report.experiment.findings]
    if said:
        yield from ("## The record", "")
        yield from (f"- {where}: {text}" for where, text in said)


def _said(method: str) -> str:
    return method.replace("_", " ")


def _with_interval(found: Identification, name: str) -> str:
    if name not in found.estimates:
        return ""
    each = found.estimates[name]
    return f"{_value(each)} {_interval(each)}".strip()


def _width(each: Estimate) -> float:
    """Return half the width of the interval, or the standard error, or 0 where nothing is known."""
    if each.ci95 is not None:
        return (each.ci95[1] - each.ci95[0]) / 2
    return each.stderr or 0.0


def _written(value: float, width: float) -> str:
    """Return a number with two digits of its uncertainty."""
    if not (math.isfinite(value) and math.isfinite(width)):
        return f"{value:g}"
    if not width or not value:
        return f"{value:.{DIGITS}g}"
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(width)) + 2
    return f"{value:.{min(max(digits, 2), 12)}g}"


def _value(each: Estimate) -> str:
    return _written(each.value, _width(each))


def _interval(each: Estimate) -> str:
    if each.ci95 is None:
        return ""
    low, high = (_written(end, _width(each)) for end in each.ci95)
    return f"[{low}, {high}]"
