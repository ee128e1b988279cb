"""The sheet of a diagnosis: residuals, forecasts, residual torque, ranking, effect run by run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pendmap.figures import candidates, gap, lacking
from pendmap.figures import sheet as sheets
from pendmap.figures.blocks import Box

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pendmap.discrepancy import Discrepancy

__all__ = ["figure"]

SIZE: Final = (8.6, 12.0)
"""Width and height in inches."""


def figure(found: Discrepancy, *, dpi: float) -> Figure:
    """Return the figure of a diagnosis; see :func:`pendmap.figures.draw_discrepancy`."""
    rms = found.gap
    names = ", ".join(effect.name for effect in found.effects) or "no effect claimed"
    subtitle = (
        f"residual {1e3 * rms.before:.3g} mrad before, {1e3 * rms.after:.3g} after, noise "
        f"{1e3 * rms.noise_floor:.3g};   held out {1e3 * rms.held_out_before:.3g} before, "
        f"{1e3 * rms.held_out_after:.3g} after"
    )
    made = sheets.headed(SIZE, dpi, f"{found.verdict}: {names}", subtitle, left=0.75)
    gap.draw_residuals(made, Box(0.85, 8.7, 7.45, 2.38), found)
    left, right = Box(0.85, 6.35, 7.45, 1.55).columns(2, 0.75)
    gap.draw_by_run(left.panel(made), found)
    if found.forecasts:
        axes = right.panel(made)
        gap.draw_forecast(axes, found, max(found.forecasts, key=lambda f: f.starts))
        axes.legend(loc="upper left", ncols=3, columnspacing=1.0, handlelength=1.4)
    cells = Box(0.85, 3.75, 7.45, 1.6).columns(2, 0.75)
    for box, over in zip(cells, ("angle", "velocity"), strict=True):
        axes = box.panel(made)
        lacking.draw_torque(axes, found, over)
        axes.set_title(f"Torque that the model lacks, over {over}")
    candidates.draw_ranking(sheets.place(made, 2.05, 0.6, 2.15, 2.3), found)
    shown = candidates.shown_coefficients(found)
    if shown:
        axes = sheets.place(made, 5.35, 0.6, 2.95, 2.3)
        candidates.draw_coefficients(axes, found, shown[0])
    return made
