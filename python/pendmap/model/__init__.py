"""The models: a pendulum without dimensions, a rig in SI, their effects and their files."""

from pendmap.model.effects import Effect as Effect
from pendmap.model.files import load_model as load_model
from pendmap.model.files import parse_model as parse_model
from pendmap.model.files import save_model as save_model
from pendmap.model.formula import Formula as Formula
from pendmap.model.formula import load_formulas as load_formulas
from pendmap.model.pendulum import PRESETS as PRESETS
from pendmap.model.pendulum import Pendulum as Pendulum
from pendmap.model.pendulum import effects_of as effects_of
from pendmap.model.rig import Rig as Rig
from pendmap.model.rig import without_dimensions as without_dimensions
from pendmap.model.tables import model_text as model_text
from pendmap.units import Units as Units
