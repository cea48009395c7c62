"""Joint fit of the camera's pose and of every marker to all sightings of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.camera.pinhole import CameraPose, PinholeCamera
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.estimator.fit import carried_correction, fitted
from marker_tracker_node.tracking.estimator.numbers import (
    CABLE,
    COUNT,
    FOCAL,
    NUMBERS,
    PLACE,
    TILT,
    ZERO,
    body_without,
    camera_without,
)
from marker_tracker_node.tracking.estimator.problem import ANGLE, MARKER, TIME, Problem, Seen
from marker_tracker_node.tracking.frame.run_means import (
    BENT_OVER_RUN,
    MEMORY,
    REFERENCE_FRAMES,
    bent_height,
)

# A correction of so many of its own standard deviations is no chance: with a right pose 70 random
# scenes reached 3.0 at most.
CARRIED = 4.0
# Numbers beside the pose that are not taken as they are configured. Paint that is not as thick as
# the cable looks like a cable of another diameter.
_DOUBTS = {number: NUMBERS[number].doubt for number in (ZERO, CABLE)}
_POSE = np.arange(TILT, FOCAL)


@dataclass(frozen=True, kw_only=True)
class Sightings:
    """Measured bands of a run.

    Attributes:
        rows: See `Seen.rows`, whose times are of no account, shape (k, 11).
        means: Run means of each marker's wound angle [rad] and z [m] from P0, shape (2, markers),
            nan for one that is not known.
        without: Errors of focal length and body that were taken off for azimuth and z, see `Seen`.
    """

    rows: FloatArray
    pose: CameraPose  # Of the camera with which azimuth and z were computed
    means: FloatArray
    without: FloatArray = field(default_factory=lambda: np.zeros(COUNT))


@dataclass(frozen=True, kw_only=True)
class Refinement:
    """Result of the joint fit."""

    pose: CameraPose  # Of the camera
    moved: FloatArray  # From the pose of the sightings: tilt [rad] and position [m], shape (6,)
    sigma_pose: FloatArray  # One standard deviation of tilt [rad] and position [m], shape (6,)
    theta: FloatArray  # Wound angle of each marker relative to P0 [rad], nan for one never seen
    z: FloatArray  # Axial position relative to P0 [m], nan likewise
    sigma_theta: FloatArray  # One standard deviation [rad]
    sigma_z: FloatArray  # One standard deviation [m]
    residual: float  # Root mean square distance between picture and model [px]
    sightings: int  # How many went in


def refine(
    config: TrackerConfig,
    camera: PinholeCamera,
    sightings: Sightings,
    belief: PoseBelief | None = None,
) -> Refinement:
    """Fit pose, encoder shift and all markers at once.

    P0 is the origin of wound angles and heights; its azimuth is the cylinder angle. The pose is
    moved only where the sightings determine it better than the prior, see `carried_correction`.
    Where it stays, so do the run means; only their deviations are new.

    Args:
        config: Machine and cable, nominal pose of the camera.
        camera: Content of CameraInfo.
        sightings: Of a run, see `Tracker.sightings`.
        belief: How well the nominal pose was known; see `PoseBelief` for what is taken if None.

    Raises:
        ValueError: There are too few sightings, or P0 was never seen.
    """
    rows, total = sightings.rows.copy(), len(sightings.rows)
    if total < REFERENCE_FRAMES:
        least = f"at least {REFERENCE_FRAMES:.0f} sightings"
        raise ValueError(f"a refinement needs {least}, got {total}")
    if not (rows[:, MARKER] == 0).any():
        raise ValueError("a refinement needs sightings of P0, there are none")
    belief = PoseBelief() if belief is None else belief
    # The cylinder's angle of each frame is known, and serves as time.
    rows[:, TIME] = rows[:, ANGLE]
    stride = -(-total // (MEMORY * (config.marker_count + 1)))
    seen = Seen(
        rows=np.concatenate([rows[rows[:, MARKER] == n][::stride] for n in np.unique(rows[:, 0])]),
        motion=np.repeat([[rows[:, TIME].min()], [rows[:, TIME].max() + 1.0]], 2, axis=1),
        area=math.nan,
        zeroed=True,
        camera=camera_without(camera, sightings.without),
        used=sightings.pose,
        nominal=config.pose,
        body=body_without(config.body, sightings.without),
    )
    problem = Problem(seen)
    prior = problem.doubting({**_DOUBTS, **dict(enumerate(belief.sigmas.tolist(), TILT))})
    start, nominal = problem.start.copy(), config.pose.numbers - sightings.pose.numbers
    start[_POSE] = nominal
    best = fitted(problem, prior, start)
    data, follow, information = best.information(_POSE)
    moved, covariance = carried_correction(
        data, nominal - best.x[_POSE], nominal, belief.sigmas, CARRIED
    )
    pose = CameraPose.of(sightings.pose.numbers + moved)
    held = Problem(replace(seen, nominal=pose))
    x = fitted(held, held.doubting(_DOUBTS), held.start).x
    variance = np.zeros(x.size)
    variance[np.delete(np.arange(x.size), _POSE)] = np.diag(
        np.linalg.inv(information) + follow @ covariance @ follow.T
    )
    places, spread = held.places(x), held.places(variance)
    if not moved.any():
        means = sightings.means[:, held.markers]
        places[:] = np.where(np.isnan(means), places, means)
    spread[1] += (BENT_OVER_RUN * bent_height(config.body)) ** 2
    found = np.full((4, config.marker_count + 1), math.nan)
    found[:, held.markers] = [*places, *np.sqrt(spread)]
    found[:, 0] = 0.0
    off, _ = held.linearised(x)
    return Refinement(
        pose=pose,
        moved=moved,
        sigma_pose=np.sqrt(np.diag(covariance)),
        theta=found[0],
        z=found[1],
        sigma_theta=found[2],
        sigma_z=found[3],
        residual=math.sqrt(2.0 * float((off**2).mean())),
        sightings=total,
    )


@dataclass(frozen=True, kw_only=True)
class PoseBelief:
    """How well the nominal pose was known before the run, one standard deviation.

    What is taken by default is a camera on a bracket, set by tape measure and spirit level.
    """

    position: float = NUMBERS[PLACE + 1].doubt  # Of each coordinate [m]; zero where it is known
    tilt: float = NUMBERS[TILT].doubt  # About each axis [rad]; zero where it is known

    def __post_init__(self) -> None:
        for name in ("position", "tilt"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must not be negative, got {value}")

    @property
    def sigmas(self) -> FloatArray:
        """Of tilt [rad] and position [m], shape (6,)."""
        return np.array([self.tilt] * 3 + [self.position] * 3)
