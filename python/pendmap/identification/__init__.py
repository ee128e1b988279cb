"""Identification of damping from free decays: the trajectory method, the paper's, and others."""

from __future__ import annotations

from pendmap.formatting import Estimate as Estimate
from pendmap.identification.experiment import identified_model as identified_model
from pendmap.identification.experiment import identify as identify
from pendmap.identification.methods.base import Identification as Identification
from pendmap.identification.methods.registry import METHODS as METHODS
from pendmap.identification.peaks import Peaks as Peaks
from pendmap.identification.peaks import find_peaks as find_peaks
from pendmap.identification.report import IdentificationReport as IdentificationReport
from pendmap.identification.table1 import PeakErrors as PeakErrors
from pendmap.identification.table1 import Table1 as Table1
from pendmap.identification.table1 import table1 as table1
