"""Tools for sampled signals, independent of any model of the pendulum."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
Stretch = tuple[int, int]  # first index and the one after the last
