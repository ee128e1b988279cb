"""Identification of damping from free decays: the trajectory method, the paper's, and others."""

from __future__ import annotations

from pendmap.formatting import Estimate
from pendmap.identification.experiment import identified_model, identify_experiment
from pendmap.identification.fit import TrajectoryFit, fit_runs
from pendmap.identification.methods.base import Identification
from pendmap.identification.methods.registry import METHODS, identify
from pendmap.identification.peaks import Peaks, find_peaks
from pendmap.identification.readings import Reading, as_fit_run, reading_of
from pendmap.identification.report import IdentificationReport
from pendmap.identification.runs import FitRun, Pivot
from pendmap.identification.table1 import PeakErrors, Table1, table1

__all__ = [
    "METHODS",
    "Estimate",
    "FitRun",
    "Identification",
    "IdentificationReport",
    "PeakErrors",
    "Peaks",
    "Pivot",
    "Reading",
    "Table1",
    "TrajectoryFit",
    "as_fit_run",
    "find_peaks",
    "fit_runs",
    "identified_model",
    "identify",
    "identify_experiment",
    "reading_of",
    "table1",
]
