"""Models drawn from what a fit knows of its parameters, and results over all draws.

``sample`` draws the models, ``match`` finds an attractor or orbit again in each of them; the other
modules, one for each analysis, gather what its results say over all draws.
"""

from pendmap.analysis.draws.sample import Draws, drawn, part

__all__ = ["Draws", "drawn", "part"]
