"""Validation of a model on records it was not fitted to: decays, forced runs, forecasts, peaks.

``free`` and ``forced`` compare a model file with a run, ``experiment`` with all runs. ``data``
divides records into those fitted and those held out; ``forecast`` computes the errors of two fitted
models on both, against the horizon, and those of periods and peaks.
"""

from pendmap.comparison.experiment import Comparison, compare
from pendmap.comparison.forced import Ensemble, ForcedComparison
from pendmap.comparison.free import RunComparison

__all__ = ["Comparison", "Ensemble", "ForcedComparison", "RunComparison", "compare"]
