"""Damping from records of free decays: the trajectory method, the paper's, and others."""

from __future__ import annotations

from pendmap.formatting import Estimate
from pendmap.identification.experiment import identified_model, identify_experiment
from pendmap.identification.methods.base import Identification
from pendmap.identification.methods.registry import METHODS, Method, identify
from pendmap.identification.methods.start import StartingValues, global_start, starting_values
from pendmap.identification.peaks import Peaks, find_peaks
from pendmap.identification.report import IdentificationReport
from pendmap.identification.table1 import PeakErrors, Row, Table1, table1

__all__ = [
    "METHODS",
    "Estimate",
    "Identification",
    "IdentificationReport",
    "Method",
    "PeakErrors",
    "Peaks",
    "Row",
    "StartingValues",
    "Table1",
    "find_peaks",
    "global_start",
    "identified_model",
    "identify",
    "identify_experiment",
    "starting_values",
    "table1",
]
