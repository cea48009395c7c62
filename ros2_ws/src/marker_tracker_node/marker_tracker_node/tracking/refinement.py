"""Joint fit of the camera's pose and of every marker to all sightings of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import CameraPose, PinholeCamera
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.frame.run_means import BENT_OVER_RUN, bent_height
from marker_tracker_node.tracking.sightings import GatedBands, Sightings

FloatArray = NDArray[np.float64]

LEAST_SIGHTINGS = 20
# More sightings add nothing: what they have wrong together is not averaged out.
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
# A correction of so many of its own standard deviations is no chance: with a right pose 26 random
# scenes reached 2.7 at most.
CARRIED = 5.0
BoolArray = NDArray[np.bool_]
IndexArray = NDArray[np.int64]
# One standard deviation [px] along the cylinder and across it, of a constant, of what goes with the
# sine of the azimuth, and with twice its square less one. Of all bands in common: so much was left
# at the true pose in 23 random scenes of the simulated camera. Of one marker beside that. And of
# bands beside another turn, whose one free side is not made up for by the other.
COMMON = ((0.1, 0.05), (0.06, 0.12), (0.06, 0.06))
OF_MARKER = ((0.05, 0.05), (0.05, 0.05), (0.05, 0.05))
OF_CUT = ((0.3, 0.1), (0.2, 0.1), (0.2, 0.1))
# Of the radius that is painted, over that of the cable: tape of 0.05 mm, or a sleeve, on 2 to 5 mm.
PAINT_SIGMA = 0.02
# A turn whose axis is nearer than this may hide or cut off a part, in radii of the cable: where it
# lies is believed to some tenths of a radius.
BESIDE = 2.6
# How far a gate cuts into a band is known to so much beyond that, in each frame anew [px].
CUT_SCATTER = 0.25


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
    moved only where the sightings determine it better than was believed, see `carried_correction`.
    Where it stays, so do the run means; only their deviations are new.

    Args:
        config: Machine and cable, nominal pose of the camera.
        camera: Content of CameraInfo.
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
    # What a change of the pose does to everything else, and what the data alone know of it.
    follow = np.linalg.solve(information[rest, rest], information[rest, pose])
    data = information[pose, pose] - information[pose, rest] @ follow
    moved, covariance = carried_correction(data, best[pose], nominal, belief)
    held = np.concatenate([moved, best[rest] - follow @ (moved - best[pose])])
    final = fit.solved(held, np.zeros(POSE_SIZE), moved) if moved.any() else fit.means(held)
    spread = np.linalg.inv(information[rest, rest]) + follow @ covariance @ follow.T
    return fit.refinement(final, moved, covariance, np.sqrt(np.diag(spread)), total)


class _Fit:
    """Least squares of pose (6), shift, wound angles, heights, mask biases and paint."""

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
        shapes, sigmas = bias_shapes(sightings, self._row, cuts)
        body = self._body._replace(cable_radius=(1.0 + PAINT_SIGMA) * self._body.cable_radius)
        thicker = GatedBands(camera, body, sightings).measured - self._bands.measured
        self._biases = np.column_stack([shapes, self._focal * thicker.ravel()])
        self._bias_sigmas = np.append(sigmas, 1.0)

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


@dataclass(frozen=True, kw_only=True)
class PoseBelief:
    """How well the nominal pose was known before the run, one standard deviation.

    What is taken by default is a camera on a bracket, set by tape measure and spirit level.
    """

    position: float = 2.0e-3  # Of each coordinate [m]; zero where it is known
    tilt: float = 10.0e-3  # About each axis [rad]; zero where it is known

    def __post_init__(self) -> None:
        for name in ("position", "tilt"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must not be negative, got {value}")

    @property
    def sigmas(self) -> FloatArray:
        """Of tilt [rad] and position [m], shape (6,)."""
        return np.array([self.tilt] * 3 + [self.position] * 3)


def carried_correction(
    data: FloatArray, best: FloatArray, nominal: FloatArray, belief: PoseBelief
) -> tuple[FloatArray, FloatArray]:
    """Return the part of a fitted change of pose that the data carry, and its covariance.

    In units of the belief the data's information has six axes of its own. Along one of them the
    change is taken whole if it is `CARRIED` standard deviations of the data or more, and else left
    out: a right pose is then left alone. What was left out counts as error.

    Args:
        data: Information on the pose without any belief, shape (6, 6).
        best: Fitted change from the present pose, tilt [rad] and position [m], shape (6,).
        nominal: Change that would lead to the nominal pose, shape (6,).
        belief: How well that was known.
    """
    sigmas = belief.sigmas
    free = sigmas > 0.0
    moved, covariance = np.zeros(6), np.zeros((6, 6))
    moved[~free] = nominal[~free]
    if not free.any():
        return moved, covariance
    unit = sigmas[free]
    information = data[np.ix_(free, free)] * np.outer(unit, unit)
    strength, axes = np.linalg.eigh(0.5 * (information + information.T))
    strength = np.maximum(strength, 0.0)
    change = axes.T @ (best[free] / unit)
    # The data alone would go further than the compromise with the belief does.
    centre = axes.T @ (nominal[free] / unit)
    alone = change + (change - centre) / np.maximum(strength, 1.0e-12)
    carried = np.abs(alone) * np.sqrt(strength) >= CARRIED
    taken = np.where(carried, change, 0.0)
    variance = 1.0 / (1.0 + strength) + (change - taken) ** 2
    moved[free] = unit * (axes @ taken)
    covariance[np.ix_(free, free)] = np.outer(unit, unit) * ((axes * variance) @ axes.T)
    return moved, covariance


def cut_off(sightings: Sightings, cable_radius: float) -> tuple[BoolArray, BoolArray]:
    """Return which bands lie beside a turn at -z, and at +z, that may cut them off, shape (k,)."""
    s, near = sightings, BESIDE * cable_radius
    return (s.low > -math.pi) | (s.below < near), (s.high < math.pi) | (s.above < near)


def bias_shapes(
    sightings: Sightings, row: IndexArray, cuts: tuple[BoolArray, BoolArray]
) -> tuple[FloatArray, FloatArray]:
    """Return what each unit of bias adds to the pictures, and what is believed of it.

    Args:
        sightings: Of a run.
        row: Place of each sighting's marker among those that were seen, shape (k,).
        cuts: See `cut_off`.

    Returns:
        Shapes, (2 k, biases), and one standard deviation of each [px], (biases,).
    """
    sine = np.sin(sightings.azimuth)
    shapes = [np.ones(sine.size), sine, 2.0 * sine**2 - 1.0]
    groups = [(np.ones(sine.size), COMMON)]
    groups += [((row == i).astype(float), OF_MARKER) for i in np.unique(row)]
    groups += [(cut.astype(float), OF_CUT) for cut in cuts if cut.any()]
    columns, sigmas = [], []
    for group, believed in groups:
        for shape, both in zip(shapes, believed, strict=True):
            for axis, sigma in enumerate(both):
                column = np.zeros((sine.size, 2))
                column[:, axis] = group * shape
                columns.append(column.ravel())
                sigmas.append(sigma)
    return np.column_stack(columns), np.array(sigmas)
