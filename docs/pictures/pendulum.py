"""Draw pendulum.png: the pendulum, its drive, friction and angle."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("agg")
import matplotlib.pyplot as plt
from matplotlib.patches import Arc, Circle

GREY, BLUE, ORANGE = "#7f7f7f", "#3b8ec2", "#d5701e"
"""Readable on white and on black."""


def main() -> None:
    """Draw and save."""
    figure, axis = plt.subplots(figsize=(4.2, 3.6))
    angle = np.radians(35)
    bob = 2.0 * np.array([np.sin(angle), -np.cos(angle)])
    arrow = {"arrowstyle": "<->", "color": ORANGE, "lw": 1.8}
    axis.plot([0, 0], [0, -2.3], "--", color=GREY, lw=1.2)
    axis.plot([0, bob[0]], [0, bob[1]], color=GREY, lw=3, solid_capstyle="round")
    axis.add_patch(Circle(bob, 0.17, color=BLUE, zorder=3))
    axis.add_patch(Circle((0, 0), 0.09, facecolor="none", edgecolor=GREY, lw=2.5, zorder=3))
    axis.add_patch(Arc((0, 0), 1.8, 1.8, theta1=270, theta2=305, color=GREY, lw=1.5))
    axis.text(0.22, -1.18, r"$\theta$", color=GREY, fontsize=15)
    axis.annotate("", (-0.35, 0.55), (-0.35, -0.55), arrowprops=arrow)
    axis.text(-0.5, 0, r"$Y \cos \Omega t$", color=ORANGE, fontsize=14, ha="right", va="center")
    axis.add_patch(Arc((0, 0), 0.55, 0.55, theta1=20, theta2=160, color=ORANGE, lw=1.8))
    axis.annotate("", (0.275, 0.02), (0.262, 0.09), arrowprops={**arrow, "arrowstyle": "->"})
    axis.text(0.42, 0.16, "damping $c$, friction $T_r$", color=ORANGE, fontsize=11, va="center")
    axis.text(bob[0] + 0.28, bob[1], "$m$", color=BLUE, fontsize=15, va="center")
    axis.annotate(
        "", (2.1, -1.5), (2.1, -0.7), arrowprops={"arrowstyle": "->", "color": GREY, "lw": 1.8}
    )
    axis.text(2.2, -1.1, "$g$", color=GREY, fontsize=15, va="center")
    axis.set(xlim=(-2.1, 2.7), ylim=(-2.45, 0.75), aspect="equal")
    axis.axis("off")
    path = Path(__file__).with_name("pendulum.png")
    figure.savefig(path, dpi=130, transparent=True, bbox_inches="tight")


if __name__ == "__main__":
    main()
