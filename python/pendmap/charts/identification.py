"""Table 1 of a record as words: what each method finds, and what its simulation misses."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendmap.charts.methods import look
from pendmap.formatting import estimate_text

if TYPE_CHECKING:
    from pendmap.identification import IdentificationReport


QUANTITIES: Final = (("w0", "w0 (rad/s)"), ("c_over_m", "c/m (1/s)"), ("Tr", "Tr (rad/s\u00b2)"))
"""What methods find: the name in a report, and that of the column."""
MINUS: Final = "\N{MINUS SIGN}"
"""How numbers in pictures are written."""
RESTS: Final = "at rest"
"""What stands for an error where a simulation has come to rest before."""
_MANY: Final = 100.0
_FEW: Final = 1e-3


def columns(report: IdentificationReport) -> list[str]:
    """Return the names of the columns."""
    errors = [
        f"period {row.measured:.3g} s" if row.what == "period" else f"peak {row.measured:.3g} rad"
        for row in report.table.rows
    ]
    overall = [] if report.table.left_out else ["periods, rms", "peaks, rms"]
    return ["method", *(said for _, said in QUANTITIES), *errors, *overall]


def rows(report: IdentificationReport) -> list[list[str]]:
    """Return a row for each method that can be applied; errors in percent, absolute."""
    made = []
    for name, found in report.methods.items():
        if not found.applicable:
            continue
        cells = [look(name).label]
        cells += [
            estimate_text(found.estimates[key], minus=MINUS)
            if key in found.estimates
            else "\N{EN DASH}"
            for key, _ in QUANTITIES
        ]
        cells += [_percent(row.errors.get(name, math.nan)) for row in report.table.rows]
        if not report.table.left_out:
            errors = report.table.errors.get(name)
            cells += (
                ["\N{EN DASH}"] * 2
                if errors is None
                else [
                    _percent(errors.period_rms),
                    _percent(errors.peak_rms),
                ]
            )
        made.append(cells)
    return made


def refused(report: IdentificationReport) -> list[tuple[str, str]]:
    """Return the methods that cannot be applied, and why."""
    made = []
    for name, found in report.methods.items():
        if not found.applicable:
            why = found.warnings[-1] if found.warnings else "not applicable"
            made.append((look(name).label, why))
    return made


def _percent(value: float) -> str:
    """Return three digits, or that the simulation rests by then."""
    if math.isnan(value):
        return RESTS
    if value >= _MANY:
        return f"{value:.0f}"
    if value >= _FEW or value == 0:
        return f"{value:.3g}"
    return f"{value:.0e}"
