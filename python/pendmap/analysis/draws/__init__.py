"""Models drawn from the covariance of fitted parameters, and results over all draws.

``sample`` draws the models, ``match`` identifies attractors and orbits between models; the other
modules, one for each analysis, compute statistics of its results over the draws.
"""

from pendmap.analysis.draws.sample import Draws, drawn, part

__all__ = ["Draws", "drawn", "part"]
