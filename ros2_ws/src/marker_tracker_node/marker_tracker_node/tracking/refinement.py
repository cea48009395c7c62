"""Joint fit of the camera's pose and of every marker to all sightings of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import CameraPose, PinholeCamera
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.mask_bias import CUT_SCATTER, bias_shapes, cut_off
from marker_tracker_node.tracking.pose_correction import PoseBelief, carried_correction
from marker_tracker_node.tracking.sightings import GatedBands, Sightings
from marker_tracker_node.tracking.uncertainty import BENT_OVER_RUN, bent_height

FloatArray = NDArray[np.float64]

LEAST_SIGHTINGS = 20
# More sightings say nothing new: what they have wrong together is not averaged out.
MOST_SIGHTINGS = 4000
POSE_SIZE = 6
# Prior of the encoder's zero [rad].
SHIFT_SIGMA = 0.02
# Least deviation of a single sighting [px], and how many of its deviations make an outlier.
LEAST_SCATTER = 0.03
OUTLIER = 2.5
STEPS = 12
SETTLED = 1.0e-7
SMALL = np.array([1.0e-6] * 3 + [1.0e-6] * 3 + [1.0e-6, 1.0e-7])


@dataclass(frozen=True, kw_only=True)
class Refinement:
    """What the joint fit says.

    Attributes:
        pose: Of the camera.
        moved: From the pose of the sightings: tilt [rad] and position [m], shape (6,).
        sigma_pose: One standard deviation of tilt [rad] and position [m], shape (6,).
        theta: Wound angle of each marker relative to P0 [rad], nan for one never seen.
        z: Axial position relative to P0 [m], nan likewise.
        sigma_theta: One standard deviation [rad].
        sigma_z: One standard deviation [m].
        residual: Root mean square distance between picture and model [px].
        sightings: How many went in.
    """

    pose: CameraPose
    moved: FloatArray
    sigma_pose: FloatArray
    theta: FloatArray
    z: FloatArray
    sigma_theta: FloatArray
    sigma_z: FloatArray
    residual: float
    sightings: int


def refine(
    config: TrackerConfig,
    camera: PinholeCamera,
    sightings: Sightings,
    belief: PoseBelief | None = None,
) -> Refinement:
    """Fit pose, encoder shift and all markers at once.

    P0 is the origin of wound angles and heights; its azimuth is the cylinder angle. The pose is
    moved only where the sightings say more of it than was believed, see `carried_correction`.
    Where it stays, so do the run means; only their deviations are new.

    Args:
        config: Machine and cable, nominal pose of the camera.
        camera: What CameraInfo says.
        sightings: Of a run, see `Tracker.sightings`.
        belief: How well the nominal pose was known; see `PoseBelief` for what is taken if None.

    Raises:
        ValueError: There are too few sightings, or P0 was never seen.
    """
    total = len(sightings.marker)
    if total < LEAST_SIGHTINGS:
        raise ValueError(f"a refinement needs at least {LEAST_SIGHTINGS} sightings, got {total}")
    if not (sightings.marker == 0).any():
        raise ValueError("a refinement needs sightings of P0, there are none")
    fit = _Fit(config, camera, sightings.every(-(-total // MOST_SIGHTINGS)))
    belief = PoseBelief() if belief is None else belief
    start = fit.start()
    nominal = _difference(config.pose, sightings.pose)
    best = fit.solved(start, belief.sigmas, nominal)
    information, _ = fit.normal(best)
    pose, rest = slice(0, POSE_SIZE), slice(POSE_SIZE, None)
    # What a change of the pose does to everything else, and what the data alone say of the pose.
    follow = np.linalg.solve(information[rest, rest], information[rest, pose])
    data = information[pose, pose] - information[pose, rest] @ follow
    moved, covariance = carried_correction(data, best[pose], nominal, belief)
    held = np.concatenate([moved, best[rest] - follow @ (moved - best[pose])])
    final = fit.solved(held, np.zeros(POSE_SIZE), moved) if moved.any() else fit.means(held)
    spread = np.linalg.inv(information[rest, rest]) + follow @ covariance @ follow.T
    return fit.refinement(final, moved, covariance, np.sqrt(np.diag(spread)), total)


class _Fit:
    """Least squares of pose (6), shift, wound angles, heights and mask biases."""

    def __init__(self, config: TrackerConfig, camera: PinholeCamera, sightings: Sightings) -> None:
        self._body, self._sightings = config.body, sightings
        self._bands = GatedBands(camera, config.body, sightings)
        self._count = config.marker_count + 1
        self._focal = math.sqrt(camera.k[0, 0] * camera.k[1, 1]) / camera.binning
        marker = sightings.marker
        self._seen = np.array([n for n in range(1, self._count) if (marker == n).any()], int)
        place = np.zeros(self._count, int)
        place[self._seen] = np.arange(1, self._seen.size + 1)
        self._row = place[marker]
        self._goal = self._focal * self._bands.measured
        self._first = POSE_SIZE + 1
        self._second = self._first + self._seen.size
        self._third = self._second + self._seen.size
        self._weight = np.ones(marker.size)
        cuts = cut_off(sightings, config.cable_radius)
        self._cut = cuts[0] | cuts[1]
        self._variance = LEAST_SCATTER**2
        self._biases, self._bias_sigmas = bias_shapes(sightings, self._row, cuts)

    def start(self) -> FloatArray:
        """Return the unknowns with the pose of the sightings."""
        s = self._sightings
        x = np.zeros(self._third + self._biases.shape[1])
        p0 = s.marker == 0
        x[POSE_SIZE] = np.median((s.azimuth - s.angle)[p0])
        for i, n in enumerate(self._seen):
            mine = s.marker == n
            x[self._first + i] = x[POSE_SIZE] - np.median((s.azimuth - s.angle)[mine])
            x[self._second + i] = np.median(s.z[mine])
        return x

    def means(self, x: FloatArray) -> FloatArray:
        """Return the unknowns with the run means in place of the fitted markers."""
        s = self._sightings
        theta, z = s.mean_theta[self._seen], s.mean_z[self._seen]
        x = x.copy()
        x[self._first : self._second] = np.where(
            np.isnan(theta), x[self._first : self._second], theta
        )
        x[self._second : self._third] = np.where(np.isnan(z), x[self._second : self._third], z)
        return x

    def solved(self, start: FloatArray, sigmas: FloatArray, centre: FloatArray) -> FloatArray:
        """Return the unknowns of least squares with a prior on the pose; zero sigmas hold it."""
        x = start.copy()
        held = sigmas == 0.0
        x[:POSE_SIZE][held] = centre[held]
        free = np.concatenate([~held, np.ones(x.size - POSE_SIZE, bool)])
        for _ in range(STEPS):
            self._reweigh(x)
            matrix, vector = self.normal(x)
            for i in np.flatnonzero(~held):
                matrix[i, i] += sigmas[i] ** -2
                vector[i] += sigmas[i] ** -2 * (centre[i] - x[i])
            step = np.zeros(x.size)
            step[free] = np.linalg.solve(matrix[np.ix_(free, free)], vector[free])
            x += step
            if np.abs(step[: self._third]).max() < SETTLED:
                break
        return x

    def normal(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the normal matrix and the right side at x, priors of all but the pose in it."""
        off, slopes = self._residuals(x), self._slopes(x)
        weight = np.repeat(self._weight / self._variance, 2)
        weighted = slopes * weight[:, None]
        matrix, vector = slopes.T @ weighted, weighted.T @ off
        prior = np.zeros(x.size)
        prior[POSE_SIZE] = SHIFT_SIGMA**-2
        prior[self._third :] = self._bias_sigmas**-2
        matrix[np.diag_indices(x.size)] += prior
        return matrix, vector - prior * x

    def refinement(
        self,
        x: FloatArray,
        moved: FloatArray,
        covariance: FloatArray,
        spread: FloatArray,
        total: int,
    ) -> Refinement:
        """Return the unknowns by name; `spread` has the deviations of all after the pose."""
        theta, z, sigma_theta, sigma_z = (np.full(self._count, math.nan) for _ in range(4))
        theta[0] = z[0] = sigma_theta[0] = sigma_z[0] = 0.0
        seen = self._seen
        theta[seen], z[seen] = x[self._first : self._second], x[self._second : self._third]
        sigma_theta[seen] = spread[1 : 1 + seen.size]
        bent = BENT_OVER_RUN * bent_height(self._body)
        sigma_z[seen] = np.hypot(spread[1 + seen.size : 1 + 2 * seen.size], bent)
        off = self._residuals(x)
        return Refinement(
            pose=_moved(self._sightings.pose, moved),
            moved=moved,
            sigma_pose=np.sqrt(np.diag(covariance)),
            theta=theta,
            z=z,
            sigma_theta=sigma_theta,
            sigma_z=sigma_z,
            residual=math.sqrt(2.0 * float((off**2).mean())),
            sightings=total,
        )

    def _model(self, x: FloatArray, nudge: int = -1) -> FloatArray:
        """Return the pictures in pixels, shape (k, 2), one of pose, azimuth and z nudged."""
        s = self._sightings
        change = np.where(np.arange(SMALL.size) == nudge, SMALL, 0.0)
        theta = np.concatenate([[0.0], x[self._first : self._second]])[self._row]
        z = np.concatenate([[0.0], x[self._second : self._third]])[self._row]
        pose = _moved(s.pose, x[:POSE_SIZE] + change[:POSE_SIZE])
        azimuth = s.angle + x[POSE_SIZE] - theta + change[POSE_SIZE]
        return self._focal * self._bands.pictures(pose, azimuth, z + change[POSE_SIZE + 1])

    def _residuals(self, x: FloatArray) -> FloatArray:
        off = (self._goal - self._model(x)).ravel()
        return np.asarray(off - self._biases @ x[self._third :])

    def _slopes(self, x: FloatArray) -> FloatArray:
        """Return the derivatives of the pictures, shape (2 k, unknowns)."""
        here = self._model(x)
        by = [((self._model(x, i) - here) / SMALL[i]).ravel() for i in range(POSE_SIZE + 2)]
        mine = self._row[:, None] == np.arange(1, self._seen.size + 1)
        own = np.repeat(mine.astype(float), 2, axis=0)
        by_pose = [column[:, None] for column in by[:POSE_SIZE]]
        by_azimuth, by_z = by[POSE_SIZE][:, None], by[POSE_SIZE + 1][:, None]
        return np.hstack(
            [*by_pose, by_azimuth, -own * by_azimuth, own * by_z, self._biases], dtype=float
        )

    def _reweigh(self, x: FloatArray) -> None:
        """Estimate the scatter of single sightings and let outliers count less."""
        off = self._residuals(x).reshape(-1, 2)
        self._variance = max(LEAST_SCATTER, 1.4826 * float(np.median(np.abs(off)))) ** 2
        trust = np.where(self._cut, self._variance / (self._variance + CUT_SCATTER**2), 1.0)
        far = np.hypot(off[:, 0], off[:, 1]) * np.sqrt(trust / (2.0 * self._variance))
        self._weight = trust * np.minimum(1.0, OUTLIER / np.maximum(far, OUTLIER))


def _moved(pose: CameraPose, change: FloatArray) -> CameraPose:
    tilt, position = np.array(pose.tilt) + change[:3], np.array(pose.position) + change[3:]
    return CameraPose(
        tilt=(float(tilt[0]), float(tilt[1]), float(tilt[2])),
        position=(float(position[0]), float(position[1]), float(position[2])),
    )


def _difference(pose: CameraPose, base: CameraPose) -> FloatArray:
    """Return tilt and position of a pose less those of another, shape (6,)."""
    change = np.array([*pose.tilt, *pose.position]) - np.array([*base.tilt, *base.position])
    return np.asarray(change, dtype=float)
