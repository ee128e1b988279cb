"""Diagnosis of discrepancies between a model and measurements."""

from __future__ import annotations

from pendmap.diagnosis.diagnose import diagnose, diagnosed_model
from pendmap.diagnosis.named import NamedEffect
from pendmap.diagnosis.result import Discrepancy
from pendmap.diagnosis.thresholds import Thresholds

__all__ = [
    "Discrepancy",
    "NamedEffect",
    "Thresholds",
    "diagnose",
    "diagnosed_model",
]
