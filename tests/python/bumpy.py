"""An experiment, by scipy, whose pendulum has a bump that no effect of the library describes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import solve_ivp

if TYPE_CHECKING:
    from pathlib import Path

W0, C_OVER_M = 6.2, 0.06
BUMP = {"height": 0.9, "width": 0.18}
"""Parameters of the bump, rad/s^2 and rad: 1/40 of gravity, about an angle of 0.8 rad."""
PLACE = 0.8

FILE = f"""
[[formula]]
name = "bump"
term = "height*exp(-(wrap(theta - {PLACE})/width)^2)"
parameters = {{ height = {{ power = 2 }}, width = {{ power = 0, typical = [0.08, 0.4] }} }}

[[formula]]
name = "lean"
term = "-k*sqrt(abs(v))*sign(v)"
parameters = {{ k = 1.5 }}
"""


def torque(theta: float) -> float:
    """Return the torque of the bump, rad/s^2."""
    off = math.remainder(theta - PLACE, math.tau)
    return BUMP["height"] * math.exp(-((off / BUMP["width"]) ** 2))


def experiment(folder: Path, *, seed: int = 1) -> Path:
    """Write four free decays, one of them held out, read by an encoder with noise."""
    folder.mkdir()
    rng = np.random.default_rng(seed)
    time, count = np.arange(0.0, 20.0, 0.01), math.tau / 4096
    lines = ["[rig]", "encoder_counts = 4096"]

    def slope(_: float, y: list[float]) -> list[float]:
        return [y[1], -(W0**2) * math.sin(y[0]) - C_OVER_M * y[1] + torque(y[0])]

    for k, start in enumerate((1.6, 2.4, -2.0, 1.2)):
        solved = solve_ivp(slope, (0.0, 20.0), [start, 0.0], t_eval=time, rtol=1e-11, atol=1e-12)
        reading = np.round((solved.y[0] + rng.normal(0, 1.5e-3, time.size)) / count) * count
        table = np.column_stack([time, reading])
        name = f"run_{k}.csv"
        np.savetxt(folder / name, table, delimiter=",", header="t_s,theta_rad", comments="")
        lines += ["[[run]]", f'file = "{name}"', 'kind = "free"', f"lab_time_s = {60 * k}"]
        lines += ["hold_out = true"] if k == 3 else []
    (folder / "experiment.toml").write_text("\n".join(lines), encoding="utf-8")
    return folder
