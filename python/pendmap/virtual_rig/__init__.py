"""A virtual rig: simulated experiments with known truth, for tests of identification and diagnosis.

Its equation, integrator and formulas deliberately share no code with the models that are fitted
to its records, and it imports none of them: otherwise a test on its records would only show that
the package agrees with itself.
"""

from __future__ import annotations

from pendmap.virtual_rig.effects import EFFECTS as EFFECTS
from pendmap.virtual_rig.effects import describe as describe
from pendmap.virtual_rig.experiment import Experiment as Experiment
from pendmap.virtual_rig.experiment import Request as Request
from pendmap.virtual_rig.experiment import Run as Run
from pendmap.virtual_rig.experiment import make as make
from pendmap.virtual_rig.experiment import paper_decay as paper_decay
from pendmap.virtual_rig.presets import PRESETS as PRESETS
from pendmap.virtual_rig.presets import RunPlan as RunPlan
from pendmap.virtual_rig.writer import Places as Places
from pendmap.virtual_rig.writer import held_out as held_out
from pendmap.virtual_rig.writer import places as places
from pendmap.virtual_rig.writer import write as write
