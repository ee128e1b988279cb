"""Models drawn from what a fit knows of its parameters, and what becomes of maps over them.

``sample`` draws the models, ``match`` finds an attractor or orbit again in each of them;
``basins``, ``planes``, ``orbits``, ``lifetimes`` and ``curves`` gather what a map says over all
draws, ``said`` puts it in words.
"""

from pendmap.analysis.draws.sample import Draws, Progress, drawn, part

__all__ = ["Draws", "Progress", "drawn", "part"]
