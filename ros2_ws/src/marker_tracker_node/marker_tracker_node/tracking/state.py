"""What the tracker remembers between frames, as arrays that its kernels write.

The capitals name the places in these arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# TrackerConfig.numbers
RHO, CABLE, HALF_BAND, USABLE, ALONG, ACROSS, SEARCH, SLIP, GAP, LAG, ADVANCE, SPEED = range(12)

# TrackerState.shared: what all markers have in common
(
    ANGLE,  # cylinder angle of the last frame [rad], unwrapped
    TIME,  # of the last frame [s]
    RATE,  # cylinder speed [rad/s]
    SHIFT,  # azimuth seen minus azimuth of the encoder [rad]
    SHIFT_WEIGHT,
    WRAPS,  # turns that the encoder lost by wrapping [rad]
    PATH_COUNT,  # filled places of the path
    GUIDE,  # guide position of the last frame [m]
    STARTED,
    BLIND,  # 1 while the encoder is missing
) = range(10)
SHARED_SIZE = 10

# TrackerState.marks: one row a marker
(
    STATUS,  # 1 once the marker is known
    THETA,  # run mean of the wound angle [rad]
    HEIGHT,  # run mean of z as seen [m]
    WEIGHT,  # of these means, in frames
    VAR_THETA,  # variance of a single frame [rad^2]
    VAR_HEIGHT,  # [m^2]
    AREA,  # measured over expected area
    REFERENCE,  # wound angle after its first frames [rad]
    RECENT,  # moving mean of the wound angle [rad]
    MISSES,  # frames in a row in which it should have been seen
) = range(10)
MARK_SIZE = 10

# TrackerState.candidates: something marker-coloured that may prove to be a marker
C_FIRST, C_THETA, C_HEIGHT, C_HITS, C_START, C_LAST, C_AREA = range(7)
CANDIDATE_SIZE = 7
CANDIDATES = 8

# Columns of what a frame yields of each marker: what is published, and for the refinement the
# azimuth and z as seen, the slope of the cable and the cuts by its neighbours
(
    O_THETA,
    O_HEIGHT,
    O_SIGMA_THETA,
    O_SIGMA_HEIGHT,
    O_FLAGS,
    O_AZIMUTH,
    O_SEEN,
    O_SLOPE,
    O_LOW,
    O_HIGH,
) = range(10)
OUTPUT_SIZE = 10

PATH_STEP = 0.05
PATH_SIZE = 8192


@dataclass(kw_only=True)
class TrackerState:
    """The one mutable state of a tracker.

    Attributes:
        shared: See the names above, shape (SHARED_SIZE,).
        marks: Shape (marker_count + 1, MARK_SIZE).
        candidates: Shape (CANDIDATES, CANDIDATE_SIZE), unused where C_HITS is zero.
        path: Expected z of the laid cable every PATH_STEP of wound angle [m], shape (PATH_SIZE,).
    """

    shared: FloatArray
    marks: FloatArray
    candidates: FloatArray
    path: FloatArray

    @classmethod
    def fresh(cls, marker_count: int) -> TrackerState:
        """Return the state before the first frame."""
        shared = np.zeros(SHARED_SIZE)
        shared[PATH_COUNT] = 1.0
        return cls(
            shared=shared,
            marks=np.zeros((marker_count + 1, MARK_SIZE)),
            candidates=np.zeros((CANDIDATES, CANDIDATE_SIZE)),
            path=np.zeros(PATH_SIZE),
        )
