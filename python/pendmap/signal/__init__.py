"""Tools on sampled signals that know no pendulum."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
Stretch = tuple[int, int]  # first place and the one after the last
