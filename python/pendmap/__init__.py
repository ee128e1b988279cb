"""Basin maps, attractors and damping identification of parametrically excited pendulums.

>>> import pendmap
>>> pendulum = pendmap.Pendulum(gamma=0.1, p=0.6, omega=2.0)
>>> result = pendmap.basins(pendulum, pendmap.Grid.square(40))
>>> [str(name) for name in result.attractor.values]
['oscillation 2:0', 'rotation 1:-1', 'rotation 1:+1']
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pendmap.errors import InputError
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

if TYPE_CHECKING:
    from pendmap.critical_curves import tongues
    from pendmap.grid import Axis, Grid
    from pendmap.homoclinic import melnikov
    from pendmap.maps import basins, basins_of
    from pendmap.orbits import orbit
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
    from pendmap.trajectory import advance, simulate

    __version__: str

__all__ = [
    "PRESETS",
    "Axis",
    "Effect",
    "EffectDefinition",
    "EffectParameter",
    "Experiment",
    "Finding",
    "Formula",
    "Grid",
    "InputError",
    "NoiseFloor",
    "Pendulum",
    "Rig",
    "Run",
    "Segment",
    "__version__",
    "advance",
    "basins",
    "basins_of",
    "effects",
    "load",
    "load_formulas",
    "load_model",
    "melnikov",
    "noise_floor",
    "orbit",
    "read_experiment",
    "save",
    "save_model",
    "simulate",
    "tongues",
]

_HOMES = {
    "Axis": "grid",
    "Experiment": "records",
    "Finding": "records",
    "Grid": "grid",
    "NoiseFloor": "records",
    "Run": "records",
    "Segment": "records",
    "advance": "trajectory",
    "basins": "maps",
    "basins_of": "maps",
    "load": "store",
    "melnikov": "homoclinic",
    "noise_floor": "records",
    "orbit": "orbits",
    "read_experiment": "records",
    "save": "store",
    "simulate": "trajectory",
    "tongues": "critical_curves",
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
