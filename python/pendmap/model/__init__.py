"""The models: a pendulum without dimensions, a rig in SI, their effects and their files."""

from pendmap.model.effects import Effect
from pendmap.model.files import load_model, parse_model, save_model
from pendmap.model.formula import Formula, load_formulas
from pendmap.model.pendulum import PRESETS, Pendulum, effects_of
from pendmap.model.rig import Rig, without_dimensions
from pendmap.model.tables import model_text
from pendmap.units import Units

__all__ = [
    "PRESETS",
    "Effect",
    "Formula",
    "Pendulum",
    "Rig",
    "Units",
    "effects_of",
    "load_formulas",
    "load_model",
    "model_text",
    "parse_model",
    "save_model",
    "without_dimensions",
]
