"""What the parts of a diagnosis are called in pictures."""

from __future__ import annotations

from typing import Final

ACCELERATION: Final = "rad/s\N{SUPERSCRIPT TWO}"
"""The unit of a torque per moment of inertia."""

OVER_SAID: Final = {
    "angle": "angle (rad)",
    "velocity": "velocity (rad/s)",
    "amplitude": "amplitude (rad)",
    "drive_phase": "phase of the drive (rad)",
    "lab_time": "time in the laboratory (s)",
}
"""What a residual torque is shown over, with units."""
