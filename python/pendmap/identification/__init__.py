"""Identification of damping from free decays: the trajectory method, the paper's, and others."""

from __future__ import annotations

from pendmap.formatting import Estimate
from pendmap.identification.experiment import identified_model, identify
from pendmap.identification.methods.base import Identification
from pendmap.identification.methods.registry import METHODS
from pendmap.identification.peaks import Peaks, find_peaks
from pendmap.identification.report import IdentificationReport
from pendmap.identification.table1 import PeakErrors, Table1, table1

__all__ = [
    "METHODS",
    "Estimate",
    "Identification",
    "IdentificationReport",
    "PeakErrors",
    "Peaks",
    "Table1",
    "find_peaks",
    "identified_model",
    "identify",
    "table1",
]
