"""Damping from the record of a free decay: the paper's method, its repair and its rivals."""

from __future__ import annotations

from pendmap.identification.compare import Comparison, RunComparison, compare
from pendmap.identification.forced import Ensemble, ForcedComparison
from pendmap.identification.methods import METHODS, Method, identify
from pendmap.identification.model_file import identified_model
from pendmap.identification.peaks import Peaks, find_peaks
from pendmap.identification.report import IdentificationReport, identify_experiment
from pendmap.identification.result import Estimate, Identification
from pendmap.identification.start import StartingValues, global_start, starting_values
from pendmap.identification.table1 import PeakErrors, Row, Table1, table1

__all__ = [
    "METHODS",
    "Comparison",
    "Ensemble",
    "Estimate",
    "ForcedComparison",
    "Identification",
    "IdentificationReport",
    "Method",
    "PeakErrors",
    "Peaks",
    "Row",
    "RunComparison",
    "StartingValues",
    "Table1",
    "compare",
    "find_peaks",
    "global_start",
    "identified_model",
    "identify",
    "identify_experiment",
    "starting_values",
    "table1",
]
