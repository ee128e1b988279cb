"""Where model and measurement disagree, and why."""

from __future__ import annotations

from pendmap.discrepancy.diagnose import Discrepancy, diagnose
from pendmap.discrepancy.named import NamedEffect, diagnosed_model

__all__ = ["Discrepancy", "NamedEffect", "diagnose", "diagnosed_model"]
