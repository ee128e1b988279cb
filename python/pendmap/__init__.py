"""Basin maps, attractors and damping identification of parametrically excited pendulums.

>>> import pendmap
>>> pendulum = pendmap.Pendulum(gamma=0.1, p=0.6, omega=2.0)
>>> result = pendmap.basins(pendulum, pendmap.Grid.square(40))
>>> [str(name) for name in result.attractor.values]
['oscillation 2:0', 'rotation 1:-1', 'rotation 1:+1']
"""

from __future__ import annotations

TYPE_CHECKING = False  # importing typing takes most of the time that this file takes
if TYPE_CHECKING:
    from typing import Any

    from pendmap.analysis.basins import basins, basins_of
    from pendmap.analysis.bifurcation import bifurcation
    from pendmap.analysis.fractality import (
        BasinEntropy,
        UncertaintyExponent,
        basin_entropy,
        uncertainty_exponent,
    )
    from pendmap.analysis.grid import Axis, Grid
    from pendmap.analysis.lifetime import lifetime
    from pendmap.analysis.lyapunov import lyapunov
    from pendmap.analysis.melnikov import melnikov
    from pendmap.analysis.orbits import orbit
    from pendmap.analysis.parameter_map import parameter_map
    from pendmap.analysis.tongues import tongues
    from pendmap.analysis.trajectory import advance, simulate
    from pendmap.errors import FitDiverged, InputError
    from pendmap.files.dataset import load, save
    from pendmap.model import (
        PRESETS,
        Effect,
        Formula,
        Pendulum,
        Rig,
        load_formulas,
        load_model,
        save_model,
    )
    from pendmap.model.library import EffectDefinition, EffectParameter, effects
    from pendmap.records import (
        Experiment,
        Finding,
        NoiseFloor,
        Run,
        Segment,
        noise_floor,
        read_experiment,
    )

    __version__: str

__all__ = [
    "PRESETS",
    "Axis",
    "BasinEntropy",
    "Effect",
    "EffectDefinition",
    "EffectParameter",
    "Experiment",
    "Finding",
    "FitDiverged",
    "Formula",
    "Grid",
    "InputError",
    "NoiseFloor",
    "Pendulum",
    "Rig",
    "Run",
    "Segment",
    "UncertaintyExponent",
    "__version__",
    "advance",
    "basin_entropy",
    "basins",
    "basins_of",
    "bifurcation",
    "effects",
    "lifetime",
    "load",
    "load_formulas",
    "load_model",
    "lyapunov",
    "melnikov",
    "noise_floor",
    "orbit",
    "parameter_map",
    "read_experiment",
    "save",
    "save_model",
    "simulate",
    "tongues",
    "uncertainty_exponent",
]

_HOMES = {
    "Axis": "analysis.grid",
    "BasinEntropy": "analysis.fractality",
    "Effect": "model",
    "EffectDefinition": "model.library",
    "EffectParameter": "model.library",
    "Experiment": "records",
    "Finding": "records",
    "Formula": "model",
    "Grid": "analysis.grid",
    "FitDiverged": "errors",
    "InputError": "errors",
    "NoiseFloor": "records",
    "PRESETS": "model",
    "Pendulum": "model",
    "Rig": "model",
    "Run": "records",
    "Segment": "records",
    "UncertaintyExponent": "analysis.fractality",
    "advance": "analysis.trajectory",
    "basin_entropy": "analysis.fractality",
    "basins": "analysis.basins",
    "basins_of": "analysis.basins",
    "bifurcation": "analysis.bifurcation",
    "effects": "model.library",
    "lifetime": "analysis.lifetime",
    "load": "files.dataset",
    "load_formulas": "model",
    "load_model": "model",
    "lyapunov": "analysis.lyapunov",
    "melnikov": "analysis.melnikov",
    "noise_floor": "records",
    "orbit": "analysis.orbits",
    "parameter_map": "analysis.parameter_map",
    "read_experiment": "records",
    "save": "files.dataset",
    "save_model": "model",
    "simulate": "analysis.trajectory",
    "tongues": "analysis.tongues",
    "uncertainty_exponent": "analysis.fractality",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401 (any public name)
    """Import what needs numpy and xarray when it is first used: the command answers sooner."""
    if name == "__version__":
        from importlib.metadata import version

        return version("pendmap")
    if name in _HOMES:
        import importlib

        return getattr(importlib.import_module(f"pendmap.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'pendmap' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
