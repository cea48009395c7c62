"""Every measured band of a run."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from marker_tracker_node.arrays import FloatArray, IndexArray
from marker_tracker_node.camera.pinhole import CameraPose
from marker_tracker_node.tracking.estimator.numbers import COUNT


@dataclass(frozen=True, kw_only=True)
class Sightings:
    """Every measured band of a run, one row each.

    Attributes:
        mean_theta: Run mean of each marker's wound angle from P0 [rad], shape (markers,), nan for
            one that is not known.
    """

    marker: IndexArray  # Number n, shape (k,)
    angle: FloatArray  # Cylinder angle of its frame [rad], shape (k,)
    azimuth: FloatArray  # As seen with `pose` [rad], unwrapped, shape (k,)
    z: FloatArray  # As seen with `pose` [m], shape (k,)
    slope: FloatArray  # dz/dtheta of the cable there [m/rad], shape (k,)
    low: FloatArray  # Cut by the neighbouring turn at -z, see `Band` [rad], shape (k,)
    high: FloatArray  # The same at +z, shape (k,)
    below: FloatArray  # Distance of the turn at -z, see `Band` [m], shape (k,)
    above: FloatArray  # The same at +z, shape (k,)
    pose: CameraPose  # Of the camera with which azimuth and z were computed
    mean_theta: FloatArray
    mean_z: FloatArray  # Run mean of z from P0 [m], likewise
    # Errors of focal length and body that were taken off for that, see `Seen`.
    without: FloatArray = field(default_factory=lambda: np.zeros(COUNT))
