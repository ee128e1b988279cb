"""Reading of experimental records, conversion to SI and checks; no file is written."""

from __future__ import annotations

from pendmap.records.by_hand import ByHand
from pendmap.records.experiment import Experiment, Run, Segment
from pendmap.records.noise import NoiseFloor, noise_floor
from pendmap.records.read import experiment_of, files_of, read_experiment
from pendmap.tables.findings import Finding

__all__ = [
    "ByHand",
    "Experiment",
    "Finding",
    "NoiseFloor",
    "Run",
    "Segment",
    "experiment_of",
    "files_of",
    "noise_floor",
    "read_experiment",
]
