"""What the tracker's kernels work on: constants, what is known of a run, and results."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import CameraView
from marker_tracker_node.detection.band import Body

FloatArray = NDArray[np.float64]
FlagArray = NDArray[np.bool_]
IndexArray = NDArray[np.int64]

CANDIDATES = 8
PATH_STEP = 0.05
PATH_SIZE = 8192
# By what the path is laid: the guide's readings, or the commanded feed because the next marker did
# not come, the markers lie there, or no guide moves so far.
BY_READINGS, TRIED, CONTRADICTED, IMPOSSIBLE = range(4)


class Setup(NamedTuple):
    """What stays the same from frame to frame; see `TrackerConfig`.

    Attributes:
        camera: Its pose and lens.
        body: What the bands are painted on.
        usable_azimuth: [rad]
        along_margin: [m]
        across_margin: [m]
        search_width: [m]
        slip_limit: [rad]
        expected_gap: [rad]
        lag: Wound angle in which the cable follows the guide, free length / (R + r) [rad].
        advance_per_radian: [m/rad]
        row_time: From an image row to the next, negative where the lowest is read first [s].
        torsion: Twist of the cable at a mark that is no ring, one standard deviation [rad].
    """

    camera: CameraView
    body: Body
    usable_azimuth: float
    along_margin: float
    across_margin: float
    search_width: float
    slip_limit: float
    expected_gap: float
    lag: float
    advance_per_radian: float
    row_time: float
    torsion: float


class Cylinder(NamedTuple):
    """What is known of the cylinder's rotation.

    Attributes:
        angle: In the last frame [rad], unwrapped.
        time: Of the last frame [s].
        rate: [rad/s]
        wraps: Turns that the encoder lost by wrapping [rad].
        started: Whether there was a frame.
        blind: Whether the encoder is missing.
        read: Angle when the encoder was read last [rad]; nan before that.
    """

    angle: float
    time: float
    rate: float
    wraps: float
    started: bool
    blind: bool
    read: float


class Guide(NamedTuple):
    """What is known of the guide, see `guide_readings`.

    Attributes:
        way: Since P0 landed, in the last frame [m].
        reading: Of the last frame that had one [m]; nan before.
        zero: What it reads where P0 lands [m]; nan before the first reading.
        travel: Of the readings while the cylinder turned [m].
        turned: Rotation in which that was [rad].
        offset: How much further than `way` the guide stands, as the markers say [m].
        belief: One of BY_READINGS and so on.
        since: Cylinder angle when that was decided, or P0 was found [rad].
    """

    way: float
    reading: float
    zero: float
    travel: float
    turned: float
    offset: float
    belief: int
    since: float


class Run(NamedTuple):
    """What all markers have in common.

    Attributes:
        cylinder: Its rotation.
        guide: On the carriage.
        shift: Azimuth seen minus azimuth of the encoder [rad].
        shift_weight: Of this mean, in frames.
        path_filled: Filled places of the paths.
    """

    cylinder: Cylinder
    guide: Guide
    shift: float
    shift_weight: float
    path_filled: int


class Marks(NamedTuple):
    """What is known of each marker, arrays of shape (markers,).

    Attributes:
        known: Whether the marker was found.
        theta: Run mean of the wound angle [rad].
        height: Run mean of z as seen [m].
        weight: Of these means, in frames.
        var_theta: Variance of a single frame [rad^2].
        var_height: The same of z [m^2].
        area: Measured over expected area.
        reference: Wound angle after its first frames [rad].
        recent: Moving mean of the wound angle [rad].
    """

    known: FlagArray
    theta: FloatArray
    height: FloatArray
    weight: FloatArray
    var_theta: FloatArray
    var_height: FloatArray
    area: FloatArray
    reference: FloatArray
    recent: FloatArray


class Candidates(NamedTuple):
    """Something marker-coloured that may prove to be a marker, arrays of shape (CANDIDATES,).

    Attributes:
        hits: Frames in which it was seen; zero where the place is free.
        colour: See `Picture`.
        first: Wound angle when it was seen first [rad].
        theta: Mean wound angle [rad].
        height: Mean z as seen [m].
        area: Mean of measured over expected area.
        start: Cylinder angle when it was seen first [rad].
        last: Cylinder angle when it was seen last [rad].
    """

    hits: IndexArray
    colour: IndexArray
    first: FloatArray
    theta: FloatArray
    height: FloatArray
    area: FloatArray
    start: FloatArray
    last: FloatArray


class Tracks(NamedTuple):
    """Everything that the kernels write in place.

    Attributes:
        marks: Of P0 to Pn.
        candidates: For markers that are not known yet.
        paths: Expected z of the laid cable every PATH_STEP of wound angle [m], by the guide's
            readings and by the commanded feed, shape (2, PATH_SIZE).
    """

    marks: Marks
    candidates: Candidates
    paths: FloatArray


class Output(NamedTuple):
    """What frames yield: `angle` of shape (frames,), the others of shape (frames, markers).

    Attributes:
        angle: Cylinder angle that was used [rad].
        theta: Wound angle [rad].
        height: z from P0 [m].
        sigma_theta: One standard deviation [rad]; until results are written, of a mark that is
            seen in part, by how much that of its azimuth exceeds that of a whole one.
        sigma_height: One standard deviation [m]; until then the same of z.
        flags: See `MarkerFlag`.
        azimuth: As seen [rad], nan where the marker was not measured; so are the following.
        seen_height: z as seen [m].
        slope: dz/dtheta of the cable [m/rad].
        low: See `Band` [rad].
        high: See `Band` [rad].
        below: See `Band` [m].
        above: See `Band` [m].
        left: Column where the gate ends on the side of -z, in the row of its centre [px]; nan where
            light hid a part, whose outline is fitted beyond the gate.
        right: The same on the side of +z.
    """

    angle: FloatArray
    theta: FloatArray
    height: FloatArray
    sigma_theta: FloatArray
    sigma_height: FloatArray
    flags: NDArray[np.uint32]
    azimuth: FloatArray
    seen_height: FloatArray
    slope: FloatArray
    low: FloatArray
    high: FloatArray
    below: FloatArray
    above: FloatArray
    left: FloatArray
    right: FloatArray
