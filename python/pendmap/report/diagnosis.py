"""The report of a diagnosis."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pendmap.report.document import Document
from pendmap.report.found import added, run_by_run
from pendmap.report.gap import gap, verdict, where
from pendmap.report.outlook import following, set_aside
from pendmap.report.ranking import ranked
from pendmap.report.wording import lead

if TYPE_CHECKING:
    from pendmap.diagnosis import Discrepancy

__all__ = ["diagnosis"]


def diagnosis(found: Discrepancy) -> Document:
    """Return the report of a diagnosis in its nine parts.

    Verdict; gap; where it is; figure 7; what was added; the ranking; run by run; what to record
    next; what was left out, and from which size on each effect that was not found would have shown.

    Parameters
    ----------
    found : Discrepancy
        As of :func:`pendmap.diagnosis.diagnose`.
    """
    name = Path(found.evidence.experiment.path).resolve().name
    return Document(
        f"What the model of {name} lacks",
        lead(found),
        (
            verdict(found),
            *gap(found),
            *where(found),
            added(found),
            ranked(found),
            run_by_run(found),
            following(found),
            set_aside(found),
        ),
    )
