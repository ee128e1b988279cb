"""Where model and measurement disagree, and why."""

from __future__ import annotations

from pendmap.diagnosis.diagnose import Discrepancy, diagnose
from pendmap.diagnosis.functions import FunctionScore, TorqueFunction
from pendmap.diagnosis.named import NamedEffect, diagnosed_model

__all__ = [
    "Discrepancy",
    "FunctionScore",
    "NamedEffect",
    "TorqueFunction",
    "diagnose",
    "diagnosed_model",
]
