"""A virtual rig: simulated experiments with known truth, for tests of identification and diagnosis.

Its equation, integrator and formulas deliberately share no code with the models that are fitted
to its records, and it imports none of them: otherwise a test on its records would only show that
the package agrees with itself.
"""

from __future__ import annotations

from pendmap.virtual_rig.effects import EFFECTS, describe
from pendmap.virtual_rig.experiment import Experiment, Request, Run, make, paper_decay
from pendmap.virtual_rig.presets import PRESETS, RunPlan
from pendmap.virtual_rig.writer import Places, held_out, places, write

__all__ = [
    "EFFECTS",
    "PRESETS",
    "Experiment",
    "Places",
    "Request",
    "Run",
    "RunPlan",
    "describe",
    "held_out",
    "make",
    "paper_decay",
    "places",
    "write",
]
