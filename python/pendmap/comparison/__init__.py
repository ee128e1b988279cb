"""A fitted model against the records held back: how they are divided, forecasts, periods, peaks.

``data`` divides records into what is fitted and what is held back; ``replay`` runs a model from a
state; ``forecast`` has its error over the horizon and ``cycles`` that of periods and peaks.
"""

from pendmap.comparison.cycles import Cycles, cycles_of
from pendmap.comparison.data import Evidence, evidence_of
from pendmap.comparison.forecast import Forecast, Gap, forecasts_of, gap_of
from pendmap.comparison.replay import Fits, Motion, replayed, strength_of

__all__ = [
    "Cycles",
    "Evidence",
    "Fits",
    "Forecast",
    "Gap",
    "Motion",
    "cycles_of",
    "evidence_of",
    "forecasts_of",
    "gap_of",
    "replayed",
    "strength_of",
]
