"""The median of a few numbers: NumPy's takes seconds to compile."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import called


@called
def median(values: NDArray[np.float64], count: int) -> float:  # pragma: no cover
    """Return the median of the first numbers of an array, which sorts them.

    Args:
        values: Shape (n,).
        count: How many count, 1 at least; they are sorted in place.
    """
    for k in range(1, count):
        value, place = values[k], k
        while place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value
    return float(0.5 * (values[(count - 1) // 2] + values[count // 2]))
