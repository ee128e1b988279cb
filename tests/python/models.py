"""Models that several tests use."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pendmap import Effect, Rig

if TYPE_CHECKING:
    from pathlib import Path

DRAG = Effect("quadratic_drag", {"q": 0.01})
HARMONIC = Effect("bearing_harmonic", {"amplitude": 1.5, "n": 4, "psi": 0.3})
SWING = Rig(w0=6.2, c_over_m=0.05, Tr=0.08, p=0.3, Omega=12.0, phi=0.4, effects=(DRAG, HARMONIC))

EXAMPLE = """\
format_version = 1

[pendulum]
w0 = 6.2
c_over_m = 0.05
Tr = 0.08
stroke_mm = 20      # half of the pivot's way
frequency_hz = 1.9
phi = 0.3
lab_time_s = 150.0

[[effect]]
name = "quadratic_drag"
parameters = { q = 0.012 }
ci95 = { q = [0.011, 0.013] }
probability = 0.97
approximate = false

[[effect]]
name = "bearing_harmonic"
[effect.parameters]
n = 4
amplitude = 0.6
psi = 0.1

[covariance]
names = ["w0", "c_over_m"]
matrix = [[1e-8, 0.0], [0.0, 2e-8]]

[provenance]
command = "pendmap identify lab"
made = 2024-05-01T12:00:00Z
records = [{ file = "run_00.csv", sha256 = "00ff" }]
"""


def written(folder: Path, text: str | bytes) -> Path:
    """Write a file with this text and return its path."""
    path = folder / "model.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path
