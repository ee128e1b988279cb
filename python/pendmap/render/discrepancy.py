"""The sheet of a diagnosis: residuals, forecasts, residual torque, ranking, effect run by run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pendmap.render import candidates, gap, lacking
from pendmap.render import sheet as sheets
from pendmap.render.blocks import Box

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

    from pendmap.diagnosis import Discrepancy

SIZE: Final = (8.6, 12.76)
"""Width and height in inches."""


def figure(found: Discrepancy, *, dpi: float) -> Figure:
    """Return the figure of a diagnosis; see :func:`pendmap.render.draw_discrepancy`."""
    rms = found.gap
    subtitle = (
        f"residual {1e3 * rms.before:.3g} mrad before, {1e3 * rms.after:.3g} after, noise "
        f"{1e3 * rms.noise_floor:.3g};   held out {1e3 * rms.held_out_before:.3g} before, "
        f"{1e3 * rms.held_out_after:.3g} after"
    )
    made = sheets.headed(SIZE, dpi, _title(found), subtitle, left=0.75)
    gap.draw_residuals(made, Box(0.85, 9.46, 7.45, 2.38), found)
    left, right = Box(0.85, 7.11, 7.45, 1.55).columns(2, 0.75)
    gap.draw_by_run(left.panel(made), found)
    if found.forecasts:
        most = max(found.forecasts, key=lambda f: f.starts)
        gap.draw_forecast(right.panel(made), found, most, legend=True)
    cells = Box(0.85, 4.4, 7.45, 1.6).columns(2, 0.75)
    for box, over in zip(cells, ("angle", "velocity"), strict=True):
        _torque(box, made, found, over)
    candidates.draw_ranking(sheets.place(made, 2.05, 1.25, 2.15, 2.3), found)
    shown = candidates.shown_coefficients(found)[:1]
    last = Box(5.35, 1.25, 2.95, 2.3)
    if shown:
        axes = last.panel(made)
        candidates.draw_coefficients(axes, found, shown[0])
        _beneath(made, 4.6, candidates.coefficient_handles(found, shown))
    else:
        # One run has nothing to be compared with.
        _torque(last, made, found, "amplitude")
    _beneath(made, 0.4, candidates.ranking_handles(found))
    return made


def _title(found: Discrepancy) -> str:
    """Return the verdict with its names; of classes that are not told apart with all of them."""
    alike = {names[0]: names for names in found.equivalent}
    names = [effect.name for effect in found.effects]
    if found.verdict == "ambiguous":
        names = [" or ".join(alike.get(name, [name])) for name in names]
    between = "; " if found.verdict == "ambiguous" else ", "
    return f"{found.verdict}: {between.join(names) or 'no effect claimed'}"


def _torque(box: Box, made: Figure, found: Discrepancy, over: str) -> None:
    axes = box.panel(made)
    lacking.draw_torque(axes, found, over)
    axes.set_title(f"Torque that the model lacks, over {over}")


def _beneath(made: Figure, left: float, handles: list[Artist]) -> None:
    """Write what is drawn at the lower edge, so many inches from the left."""
    whole = made.get_size_inches()
    made.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(left / whole[0], 0.08 / whole[1]),
        ncols=2,
        borderpad=0,
        borderaxespad=0,
        columnspacing=1.2,
    )
