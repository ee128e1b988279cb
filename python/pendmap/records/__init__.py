"""Reading of experimental records, conversion to SI and checks; no file is written."""

from __future__ import annotations

from pendmap.records.by_hand import ByHand as ByHand
from pendmap.records.experiment import Experiment as Experiment
from pendmap.records.experiment import Run as Run
from pendmap.records.experiment import Segment as Segment
from pendmap.records.noise import NoiseFloor as NoiseFloor
from pendmap.records.noise import noise_floor as noise_floor
from pendmap.records.read import experiment_of as experiment_of
from pendmap.records.read import files_of as files_of
from pendmap.records.read import read_experiment as read_experiment
from pendmap.tables.findings import Finding as Finding
