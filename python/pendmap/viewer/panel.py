"""A panel with two axes in a 2D view: lines in physical units in a frame with ticks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import plane
from pendmap.viewer import frame

if TYPE_CHECKING:
    from collections.abc import Sequence

Floats = npt.NDArray[np.float64]

WIDTH, HEIGHT = 1000.0, 560.0
"""Of a frame on the screen, in the view's own units."""

MARGIN: Final = 0.06
"""Part of the range that is left free above and below."""


@dataclass(frozen=True)
class Panel:
    """A panel.

    Everything is logged in physical units under ``root/data``; one static transform brings it to
    the screen, where ``root/axes`` has the frame. See :class:`pendmap.viewer.frame.Frame`.

    Attributes
    ----------
    x, y : (float, float)
        Ranges of both axes; the first below the second.
    across, up : str
        What the axes show, with units.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    across: str
    up: str

    @classmethod
    def holding(cls, x: Floats, y: Floats, across: str, up: str) -> Panel:
        """Return the panel that holds these values, those that are numbers."""
        ends = []
        for values, margin in ((x, 0.0), (y, MARGIN)):
            known = values[np.isfinite(values)]
            low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
            pad = margin * (high - low) or (0.0 if high > low else max(abs(low), 1.0) * MARGIN)
            ends.append((low - pad, high + pad))
        return cls(ends[0], ends[1], across, up)

    def view(self, root: str, name: str) -> rrb.Spatial2DView:
        """Return the view of this panel."""
        bounds = rrb.VisualBounds2D(
            x_range=[-210.0, WIDTH + 60.0], y_range=[-110.0, HEIGHT + 160.0]
        )
        return rrb.Spatial2DView(origin=f"/{root}", name=name, visual_bounds=bounds)

    def log(self, stream: rr.RecordingStream, root: str) -> None:
        """Log the transform, the frame, its ticks and the names of its axes."""
        sx, sy = WIDTH / (self.x[1] - self.x[0]), HEIGHT / (self.y[1] - self.y[0])
        transform = rr.Transform3D(
            translation=[-sx * self.x[0], sy * self.y[1], 0.0], mat3x3=np.diag([sx, -sy, 1.0])
        )
        stream.log(f"{root}/data", transform, static=True)
        lines: list[list[list[float]]] = [
            [[0, 0], [WIDTH, 0], [WIDTH, HEIGHT], [0, HEIGHT], [0, 0]]
        ]
        places: list[list[float]] = [[WIDTH / 2, HEIGHT + 75], [0, -85]]
        labels = [self.across, self.up]
        (right, along), (up, rising) = (
            plane.short_ticks(*ends, angle=False) for ends in (self.x, self.y)
        )
        labels = [plane.shifted(self.across, right), plane.shifted(self.up, up)]
        for value, label in along:
            at = sx * (right + value - self.x[0])
            lines.append([[at, HEIGHT], [at, HEIGHT + 12]])
            places.append([at, HEIGHT + 20])
            labels.append(label)
        for value, label in rising:
            at = sy * (self.y[1] - up - value)
            lines.append([[-12, at], [0, at]])
            places.append([-80, at - 22])
            labels.append(label)
        thin = rr.Radius.ui_points(0.75)
        shown = rr.LineStrips2D(lines, colors=[frame.INK], radii=thin)
        stream.log(f"{root}/axes/frame", shown, static=True)
        frame.write(stream, f"{root}/axes/ticks", places, labels)

    def within(self, lines: Sequence[Floats]) -> list[Floats]:
        """Return the parts of lines that lie in the panel: a view clips nothing."""
        return frame.pieces(lines, *zip(self.x, self.y, strict=True))

    def strips(  # noqa: PLR0913 (where, what, and its look)
        self,
        stream: rr.RecordingStream,
        path: str,
        lines: Sequence[Floats],
        colour: tuple[int, int, int],
        width: float,
        *,
        order: float | None = None,
    ) -> None:
        """Log lines, shape (n, 2) each, in physical units, broken where they are not numbers.

        Lines of a higher ``order`` are drawn over others; by default it is 20.
        """
        drawn = frame.pieces(lines)
        radii = rr.Radius.ui_points(width)
        strips = rr.LineStrips2D(drawn, colors=[colour], radii=radii, draw_order=order)
        stream.log(path, strips, static=True)
