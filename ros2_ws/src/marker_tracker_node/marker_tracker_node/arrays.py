"""Kinds of arrays, by what they hold."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]
IndexArray = NDArray[np.int64]
FlagArray = NDArray[np.bool_]
