"""From a stream of tracked frames to markers that have landed and stand still."""

import math
from dataclasses import dataclass

import numpy as np

from cable_fem_node.identification.tracked_run import Readings
from winding_core.markers import MarkerFlag, Markers

# A frame with one of these did not measure the marker. TOUCHING did, with a greater deviation.
_UNSEEN = int(
    MarkerFlag.OCCLUDED | MarkerFlag.CLIPPED | MarkerFlag.NOT_WOUND | MarkerFlag.PREDICTED
)


@dataclass(frozen=True, kw_only=True)
class SteadyConfig:
    """When a marker counts as measured."""

    frames: int = 20  # Frames that must have seen it
    spread: float = 8.0e-3  # Greatest standard deviation of its angle over these frames [rad]
    # What all frames may have wrong together [rad]: the camera's pose; added to the deviation that
    # the tracker states.
    systematic: float = 1.0e-3


@dataclass(kw_only=True)
class _Sum:
    frames: int = 0
    theta: float = 0.0
    theta_squares: float = 0.0
    z: float = 0.0
    variance_theta: float = 0.0
    variance_z: float = 0.0


class SteadyMarkers:
    """Means of every marker over the frames that measured it.

    Frames of one marker share the camera's errors, so the mean keeps the deviation of a single
    frame. A marker that has slipped is left out for good: its place does not follow from how it
    was laid.
    """

    def __init__(self, config: SteadyConfig | None = None) -> None:
        self._config = SteadyConfig() if config is None else config
        self._sums: dict[int, _Sum] = {}
        self._slipped: set[int] = set()

    def add(self, markers: Markers) -> None:
        """Take one frame's marker records."""
        for row in markers:
            marker, flags = int(row["id"]), int(row["flags"])
            if flags & MarkerFlag.SLIPPED:
                self._slipped.add(marker)
            numbers = [float(row[name]) for name in ("theta", "z", "sigma_theta", "sigma_z")]
            if marker < 1 or flags & _UNSEEN or not all(map(math.isfinite, numbers)):
                continue
            theta, z, sigma_theta, sigma_z = numbers
            total = self._sums.setdefault(marker, _Sum())
            total.frames += 1
            before = theta - total.theta
            total.theta += before / total.frames
            total.theta_squares += before * (theta - total.theta)
            total.z += (z - total.z) / total.frames
            total.variance_theta += sigma_theta**2
            total.variance_z += sigma_z**2

    def steady(self) -> tuple[int, ...]:
        """Return the numbers of the markers that are measured, ascending."""
        config = self._config
        return tuple(
            marker
            for marker, total in sorted(self._sums.items())
            if marker not in self._slipped
            and total.frames >= config.frames
            and math.sqrt(total.theta_squares / total.frames) <= config.spread
        )

    def readings(self) -> Readings | None:
        """Return the steady markers' means; None while there is none."""
        markers = self.steady()
        if not markers:
            return None
        sums = [self._sums[marker] for marker in markers]

        def deviation(variance: float, frames: int, floor: float) -> float:
            return math.sqrt(variance / frames + floor**2)

        return Readings(
            ids=np.array(markers, dtype=np.int64),
            theta=np.array([total.theta for total in sums]),
            z=np.array([total.z for total in sums]),
            sigma_theta=np.array(
                [deviation(s.variance_theta, s.frames, self._config.systematic) for s in sums]
            ),
            sigma_z=np.array([deviation(s.variance_z, s.frames, 1.0e-6) for s in sums]),
        )
