"""Basin maps, attractors and damping identification of parametrically excited pendulums.

>>> import pendmap
>>> pendulum = pendmap.Pendulum(gamma=0.1, p=0.6, omega=2.0)
>>> result = pendmap.basins(pendulum, pendmap.Grid.square(40))
>>> [str(name) for name in result.attractor.values]
['oscillation 2:0', 'rotation 1:-1', 'rotation 1:+1']
"""

from __future__ import annotations

TYPE_CHECKING = False  # importing typing would take most of this file's import time
if TYPE_CHECKING:
    from typing import Any

    from pendmap.analysis.basin_sweep import sweep as sweep
    from pendmap.analysis.basins import basins as basins
    from pendmap.analysis.basins import basins_of as basins_of
    from pendmap.analysis.bifurcation import bifurcation as bifurcation
    from pendmap.analysis.continuation import continuation as continuation
    from pendmap.analysis.fractality import BasinEntropy as BasinEntropy
    from pendmap.analysis.fractality import UncertaintyExponent as UncertaintyExponent
    from pendmap.analysis.fractality import basin_entropy as basin_entropy
    from pendmap.analysis.fractality import uncertainty_exponent as uncertainty_exponent
    from pendmap.analysis.grid import Axis as Axis
    from pendmap.analysis.grid import Grid as Grid
    from pendmap.analysis.lifetime import lifetime as lifetime
    from pendmap.analysis.lyapunov import lyapunov as lyapunov
    from pendmap.analysis.melnikov import melnikov as melnikov
    from pendmap.analysis.orbits import orbit as orbit
    from pendmap.analysis.parameter_map import parameter_map as parameter_map
    from pendmap.analysis.run import RunOptions as RunOptions
    from pendmap.analysis.tongues import tongues as tongues
    from pendmap.analysis.trajectory import advance as advance
    from pendmap.analysis.trajectory import simulate as simulate
    from pendmap.analysis.varied import pendulum_of as pendulum_of
    from pendmap.comparison.experiment import compare as compare
    from pendmap.diagnosis.diagnose import diagnose as diagnose
    from pendmap.engine.bar import ProgressBar as ProgressBar
    from pendmap.errors import FitDiverged as FitDiverged
    from pendmap.errors import InputError as InputError
    from pendmap.files.dataset import load as load
    from pendmap.files.dataset import save as save
    from pendmap.identification.experiment import identify as identify
    from pendmap.model import PRESETS as PRESETS
    from pendmap.model import Effect as Effect
    from pendmap.model import Formula as Formula
    from pendmap.model import Pendulum as Pendulum
    from pendmap.model import Rig as Rig
    from pendmap.model import load_formulas as load_formulas
    from pendmap.model import load_model as load_model
    from pendmap.model import save_model as save_model
    from pendmap.model.effects import EffectDefinition as EffectDefinition
    from pendmap.model.effects import EffectParameter as EffectParameter
    from pendmap.model.effects import effects as effects
    from pendmap.records import Experiment as Experiment
    from pendmap.records import Finding as Finding
    from pendmap.records import NoiseFloor as NoiseFloor
    from pendmap.records import Run as Run
    from pendmap.records import Segment as Segment
    from pendmap.records import noise_floor as noise_floor
    from pendmap.records import read_experiment as read_experiment
    from pendmap.render.axes import plot as plot
    from pendmap.viewer import view as view

    __version__: str

ANALYSES = {
    "trajectory": ("simulate", ["simulate"], "Integrate one motion, with its Poincaré section."),
    "basins": ("basins", ["basins", "basins_of"], "Map the basins of attraction."),
    "basin_sweep": ("sweep", ["sweep"], "Map basins along one or two parameters."),
    "parameter_map": ("map", ["parameter_map"], "Map which attractors exist over two parameters."),
    "bifurcation": ("bifurcation", ["bifurcation"], "Draw stroboscopic points along a parameter."),
    "continuation": ("continue", ["continuation"], "Follow periodic orbits along a parameter."),
    "orbits": ("orbit", ["orbit"], "Find all periodic orbits of one period and winding."),
    "lyapunov": ("lyapunov", ["lyapunov"], "Find the largest Lyapunov exponent of an attractor."),
    "lifetime": ("lifetime", ["lifetime"], "Measure how long transient chaos lives."),
    "tongues": ("tongues", ["tongues"], "Find where rest loses its stability, in two planes."),
    "melnikov": ("melnikov", ["melnikov"], "Compute the homoclinic threshold (Melnikov)."),
}
"""Kind of result (also its module's name): command, functions that return it, description."""

_OTHERS = {
    "analysis.fractality": "BasinEntropy UncertaintyExponent basin_entropy uncertainty_exponent",
    "analysis.grid": "Axis Grid",
    "analysis.run": "RunOptions",
    "analysis.trajectory": "advance",
    "analysis.varied": "pendulum_of",
    "comparison.experiment": "compare",
    "diagnosis.diagnose": "diagnose",
    "engine.bar": "ProgressBar",
    "errors": "FitDiverged InputError",
    "files.dataset": "load save",
    "identification.experiment": "identify",
    "model": "PRESETS Effect Formula Pendulum Rig load_formulas load_model save_model",
    "model.effects": "EffectDefinition EffectParameter effects",
    "records": "Experiment Finding NoiseFloor Run Segment noise_floor read_experiment",
    "render.axes": "plot",
    "viewer": "view",
}
HOMES = {
    **{name: home for home, names in _OTHERS.items() for name in names.split()},
    **{name: f"analysis.{kind}" for kind, (_, names, _) in ANALYSES.items() for name in names},
}
"""Module of each public name."""
__all__ = sorted([*HOMES, "__version__"])  # noqa: PLE0605 (a list)


def __getattr__(name: str) -> Any:  # noqa: ANN401 (any public name)
    """Import a public name on first use: numpy and xarray are loaded only when needed."""
    if name == "__version__":
        from importlib.metadata import version

        return version("pendmap")
    if name in HOMES:
        import importlib

        return getattr(importlib.import_module(f"pendmap.{HOMES[name]}"), name)
    raise AttributeError(f"module 'pendmap' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
