"""Where model and measurement disagree, and why."""

from __future__ import annotations

from pendmap.discrepancy.diagnose import Discrepancy, diagnose
from pendmap.discrepancy.functions import FunctionScore, TorqueFunction
from pendmap.discrepancy.named import NamedEffect, diagnosed_model

__all__ = [
    "Discrepancy",
    "FunctionScore",
    "NamedEffect",
    "TorqueFunction",
    "diagnose",
    "diagnosed_model",
]
