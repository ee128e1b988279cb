"""A model against records that it was not fitted to: decays, forced runs, forecasts, peaks.

``free`` and ``forced`` compare a model file with an experiment.

``data`` divides records into what is fitted and what is held back; ``replay`` runs a model from a
state; ``forecast`` has its error over the horizon and ``cycles`` that of periods and peaks.
"""

from pendmap.comparison.cycles import Cycles, cycles_of
from pendmap.comparison.data import Evidence, evidence_of
from pendmap.comparison.forced import Ensemble, ForcedComparison
from pendmap.comparison.forecast import Forecast, Gap, forecasts_of, gap_of
from pendmap.comparison.free import Comparison, RunComparison, compare
from pendmap.comparison.replay import Fits, Motion, replayed, strength_of

__all__ = [
    "Comparison",
    "Cycles",
    "Ensemble",
    "Evidence",
    "Fits",
    "ForcedComparison",
    "Forecast",
    "Gap",
    "Motion",
    "RunComparison",
    "compare",
    "cycles_of",
    "evidence_of",
    "forecasts_of",
    "gap_of",
    "replayed",
    "strength_of",
]
