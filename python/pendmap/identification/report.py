"""Damping from an experiment by every method, with all that a table or a figure of it needs."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.identification.fitting import TrajectoryFit
from pendmap.identification.fitting_experiment import fit_experiment
from pendmap.identification.methods import METHODS, identify
from pendmap.identification.peaks import Peaks, find_peaks
from pendmap.identification.result import Identification
from pendmap.identification.table1 import Table1, table1
from pendmap.model import Rig

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pendmap.model.effects import Effect
    from pendmap.records import Experiment, Run

__all__ = ["BEST", "IdentificationReport", "identify_experiment"]

BEST: Final = "trajectory"
"""The method whose result becomes the model."""
