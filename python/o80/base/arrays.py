"""Types of arrays, named after the types of their elements."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
IntArray = NDArray[np.int64]
Image = NDArray[np.uint8]
