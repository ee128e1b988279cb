"""Diagnosis of discrepancies between a model and measurements."""

from __future__ import annotations

from pendmap.diagnosis.diagnose import diagnose as diagnose
from pendmap.diagnosis.diagnose import diagnosed_model as diagnosed_model
from pendmap.diagnosis.named import NamedEffect as NamedEffect
from pendmap.diagnosis.result import Discrepancy as Discrepancy
from pendmap.diagnosis.thresholds import Thresholds as Thresholds
