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

    from pendmap.critical_curves import tongues
    from pendmap.diagrams import bifurcation
    from pendmap.errors import FitDiverged, InputError
    from pendmap.exponents import lyapunov
    from pendmap.grid import Axis, Grid
    from pendmap.homoclinic import melnikov
    from pendmap.lifetimes import lifetime
    from pendmap.maps import basins, basins_of
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
    from pendmap.orbits import orbit
    from pendmap.planes import parameter_map
    from pendmap.records import (
        Experiment,
        Finding,
        NoiseFloor,
        Run,
        Segment,
        noise_floor,
        read_experiment,
    )
    from pendmap.store import load, save
    from pendmap.texture import BasinEntropy, basin_entropy
    from pendmap.trajectory import advance, simulate
    from pendmap.uncertainty import UncertaintyExponent, uncertainty_exponent

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
    "Axis": "grid",
    "BasinEntropy": "texture",
    "Effect": "model",
    "EffectDefinition": "model.library",
    "EffectParameter": "model.library",
    "Experiment": "records",
    "Finding": "records",
    "Formula": "model",
    "Grid": "grid",
    "FitDiverged": "errors",
    "InputError": "errors",
    "NoiseFloor": "records",
    "PRESETS": "model",
    "Pendulum": "model",
    "Rig": "model",
    "Run": "records",
    "Segment": "records",
    "UncertaintyExponent": "uncertainty",
    "advance": "trajectory",
    "basin_entropy": "texture",
    "basins": "maps",
    "basins_of": "maps",
    "bifurcation": "diagrams",
    "effects": "model.library",
    "lifetime": "lifetimes",
    "load": "store",
    "load_formulas": "model",
    "load_model": "model",
    "lyapunov": "exponents",
    "melnikov": "homoclinic",
    "noise_floor": "records",
    "orbit": "orbits",
    "parameter_map": "planes",
    "read_experiment": "records",
    "save": "store",
    "save_model": "model",
    "simulate": "trajectory",
    "tongues": "critical_curves",
    "uncertainty_exponent": "uncertainty",
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
