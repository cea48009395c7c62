"""What the tracker's kernels work on: fixed numbers, the state of a run, and results.

Every record is declared once, as a class that names its fields, of which `record_dtype` makes a
NumPy dtype. Kernels read and write arrays of that dtype by field (`marks.theta[n]`,
`run.cylinder.angle`); Python does the same through `numpy.recarray` views. Numba looks at every
field of a nested named tuple anew with each call, so the fixed numbers cross as plain tuples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias, TypeVar, cast, get_type_hints

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.arrays import FlagArray, FloatArray, IndexArray
from marker_tracker_node.camera.pinhole import CameraView
from marker_tracker_node.detection.band import Body
from winding_core.compiling import called

# A structured array of a `record_dtype`, which a kernel reads as the record class it is made of.
Rows: TypeAlias = Any
Record = TypeVar("Record")

# Places for what may prove to be a marker: a search finds a few wrong ones in any picture.
CANDIDATES = 16
# Between two places of the path its law, whose lag is a radian or more, is straight to 0.1 % [rad].
PATH_STEP = 0.05
# Rows of what is kept: four seconds of an encoder's readings at 2 kHz, as a node in arrears meets
# frames two seconds behind; three minutes of sightings; a path of 65 turns.
KEPT = 8192
# By what the path is laid: the guide's readings, or the commanded feed because the next marker did
# not come, the markers lie there, or no guide moves so far.
BY_READINGS, TRIED, CONTRADICTED, IMPOSSIBLE = range(4)


class Setup(NamedTuple):
    """What stays the same from frame to frame; see `TrackerConfig`."""

    camera: CameraView  # Its pose and lens
    body: Body  # What the bands are painted on
    usable_azimuth: float  # [rad]
    along_margin: float  # [m]
    across_margin: float  # [m]
    search_width: float  # [m]
    slip_limit: float  # [rad]
    expected_gap: float  # [rad]
    lag: float  # Wound angle in which the cable follows the guide, free length / (R + r) [rad]
    advance_per_radian: float  # [m/rad]
    row_time: float  # From an image row to the next, negative where the lowest is read first [s]
    torsion: float  # Twist of the cable at a mark that is no ring, one standard deviation [rad]
    detector: int  # See `detector_number`


# A setup as it crosses to a kernel, which takes plain tuples five times as fast as named ones.
FixedNumbers = tuple[Any, ...]


def fixed_numbers(setup: Setup) -> FixedNumbers:
    """Return a setup as plain tuples, of which `setup_of` makes it again."""
    return (tuple(setup.camera), tuple(setup.body), *setup[2:])


@called
def setup_of(fixed: FixedNumbers) -> Setup:  # pragma: no cover
    """Return the setup of which `fixed_numbers` were made."""
    return Setup(CameraView(*fixed[0]), Body(*fixed[1]), *fixed[2:])


class Cylinder:
    """What is known of the cylinder's rotation."""

    angle: float  # In the last frame [rad], unwrapped
    time: float  # Of the last frame [s]
    rate: float  # [rad/s]
    wraps: float  # Turns that the encoder lost by wrapping [rad]
    started: bool  # Whether there was a frame
    blind: bool  # Whether the encoder is missing
    read: float  # Angle when the encoder was read last [rad]; nan before that


class Guide:
    """What is known of the guide, see `follow_guide`."""

    way: float  # Since P0 landed, in the last frame [m]
    reading: float  # Of the last frame that had one [m]; nan before
    zero: float  # What it reads where P0 lands [m]; nan before the first reading
    travel: float  # Of the readings while the cylinder turned [m]
    turned: float  # Rotation in which that was [rad]
    offset: float  # How much further than `way` the guide stands, as the markers show [m]
    laid_by: int  # One of BY_READINGS and so on
    since: float  # Cylinder angle when that was decided, or P0 was found [rad]


class Run:
    """What all markers have in common."""

    cylinder: Cylinder  # Its rotation
    guide: Guide  # On the carriage
    shift: float  # Azimuth seen minus azimuth of the encoder [rad]
    shift_weight: float  # Of this mean, in frames
    path_filled: int  # Filled places of the paths


class Marks:
    """What is known of each marker, arrays of shape (markers,)."""

    known: FlagArray  # Whether the marker was found
    found: FloatArray  # Cylinder angle as it became known [rad]
    theta: FloatArray  # Run mean of the wound angle [rad]
    height: FloatArray  # Run mean of z as seen [m]
    weight: FloatArray  # Of that of the wound angle, in frames
    weight_height: FloatArray  # Of that of z, likewise
    bias_height: FloatArray  # Variance of what its frames have in common [px^2]
    lift: FloatArray  # How high its cable was measured on other turns [m]
    var_theta: FloatArray  # Variance of a single frame [rad^2]
    var_height: FloatArray  # The same of z [m^2]
    area: FloatArray  # Measured over expected area
    reference: FloatArray  # Wound angle after its first frames [rad]
    recent: FloatArray  # Moving mean of the wound angle [rad]
    doubt_theta: FloatArray  # Variance of that for what is not known of corrected numbers [rad^2]
    doubt_height: FloatArray  # The same of z [m^2]
    left_theta: FloatArray  # What published angles still have of those before a correction [rad]
    left_height: FloatArray  # The same of z [m]


class Candidates:
    """Something marker-coloured that may prove to be a marker, arrays of shape (CANDIDATES,)."""

    hits: IndexArray  # Frames in which it was seen; zero where the place is free
    colour: IndexArray  # See `Picture`
    identity: IndexArray  # See `Detection`
    first: FloatArray  # Wound angle when it was seen first [rad]
    theta: FloatArray  # Mean wound angle [rad]
    height: FloatArray  # Mean z as seen [m]
    area: FloatArray  # Mean of measured over expected area
    start: FloatArray  # Cylinder angle when it was seen first [rad]
    last: FloatArray  # Cylinder angle when it was seen last [rad]


class Output:
    """What frames yield of each marker, arrays of shape (frames, markers).

    Attributes:
        sigma_theta: One standard deviation [rad]; until results are written, by how much that of
            its azimuth exceeds that of a mark that is seen whole.
        azimuth: As seen [rad], nan where the marker was not measured; so are the following.
    """

    theta: FloatArray  # Wound angle [rad]
    height: FloatArray  # z from P0 [m]
    sigma_theta: FloatArray
    sigma_height: FloatArray  # One standard deviation [m]; until then the same of z
    azimuth: FloatArray
    seen_height: FloatArray  # z as seen [m]
    slope: FloatArray  # dz/dtheta of the cable [m/rad]
    low: FloatArray  # See `Band` [rad]
    high: FloatArray  # See `Band` [rad]
    below: FloatArray  # See `Band` [m]
    above: FloatArray  # See `Band` [m]
    lift: FloatArray  # See `Band` [m]
    covered: FlagArray  # Whether cable lies or hangs before it
    marker_flags: NDArray[np.uint32]  # See `MarkerFlag`; an array has flags of its own


_KINDS: tuple[tuple[Any, Any, type[np.generic]], ...] = (
    (float, FloatArray, np.float64),
    (bool, FlagArray, np.bool_),
    (int, IndexArray, np.int64),
    (None, NDArray[np.uint32], np.uint32),
)


def record_dtype(record: type) -> np.dtype[np.void]:
    """Return the dtype whose fields a class names, one number of each; records may hold records."""

    def kind(hint: Any) -> np.dtype[Any]:
        for number, array, dtype in _KINDS:
            if hint in (number, array):
                return np.dtype(dtype)
        return record_dtype(hint)

    hints = get_type_hints(record)
    return np.dtype([(name, kind(hint)) for name, hint in hints.items()], align=True)


RUN, MARK, CANDIDATE, SEEN = (record_dtype(kind) for kind in (Run, Marks, Candidates, Output))
# The bytes of a marker of which a frame shows nothing: nan everywhere and no flag.
_NOTHING = np.zeros((), dtype=SEEN)
for _name, (_dtype, *_) in (SEEN.fields or {}).items():
    _NOTHING[_name] = math.nan if _dtype.kind == "f" else 0
_UNSEEN = _NOTHING.tobytes()


def by_field(rows: Rows, record: type[Record]) -> Record:
    """Return a view of structured rows whose attributes are the fields of a record class."""
    return cast(Record, rows.view(np.recarray))


class Tracks(NamedTuple):
    """Everything that the kernels know of markers and cable, written in place.

    Attributes:
        paths: Expected z of the laid cable every PATH_STEP of wound angle [m], by the guide's
            readings and by the commanded feed, how high it lies on other turns by those readings
            [m], and whether others lie on it, 0 or 1, shape (4, KEPT).
    """

    marks: Marks  # Of P0 to Pn
    candidates: Candidates  # For markers that are not known yet
    paths: FloatArray


@dataclass(kw_only=True)
class TrackerState:
    """The one mutable state of a tracker."""

    run_rows: Rows  # Of RUN, shape (1,)
    mark_rows: Rows  # Of MARK, shape (markers,)
    candidate_rows: Rows  # Of CANDIDATE, shape (CANDIDATES,)
    paths: FloatArray  # See `Tracks` [m], shape (4, KEPT)

    @classmethod
    def fresh(cls, marker_count: int) -> TrackerState:
        """Return the state before the first frame."""
        state = cls(
            run_rows=np.zeros(1, dtype=RUN),
            mark_rows=np.zeros(marker_count + 1, dtype=MARK),
            candidate_rows=np.zeros(CANDIDATES, dtype=CANDIDATE),
            paths=np.zeros((4, KEPT)),
        )
        run = state.run_rows
        run["path_filled"] = 1
        run["cylinder"]["read"] = math.nan
        run["guide"]["reading"] = run["guide"]["zero"] = math.nan
        run["guide"]["laid_by"] = BY_READINGS
        return state

    @property
    def run(self) -> Run:
        """What all markers have in common, as a view."""
        return cast(Run, self.run_rows.view(np.recarray)[0])

    @property
    def marks(self) -> Marks:
        """What is known of each marker, as a view."""
        return by_field(self.mark_rows, Marks)

    @property
    def tracks(self) -> Tracks:
        """Everything that is known of markers and cable, as views."""
        return Tracks(self.marks, by_field(self.candidate_rows, Candidates), self.paths)

    # What is asked for in every frame is read without a view.

    @property
    def started(self) -> bool:
        """Whether there was a frame."""
        return bool(self.run_rows["cylinder"]["started"][0])

    @property
    def time(self) -> float:
        """Of the last frame [s]."""
        return float(self.run_rows["cylinder"]["time"][0])

    @property
    def shift(self) -> float:
        """See `Run` [rad]."""
        return float(self.run_rows["shift"][0])

    @property
    def turned(self) -> float:
        """Cylinder angle in the last frame as the camera sees it [rad]."""
        return float(self.run_rows["cylinder"]["angle"][0]) + self.shift

    @property
    def path(self) -> FloatArray:
        """That of `Tracks.paths` that is in use, shape (KEPT,)."""
        by_readings = self.run_rows["guide"]["laid_by"][0] == BY_READINGS
        path: FloatArray = self.paths[0 if by_readings else 1]
        return path


@dataclass(frozen=True, kw_only=True)
class Burst:
    """What a burst of frames yields."""

    angle: FloatArray  # Cylinder angle that was used [rad], shape (frames,)
    ahead: FloatArray  # By how much that exceeds what the encoder reports [rad], likewise
    rows: Rows  # Of SEEN, shape (frames, markers)

    @classmethod
    def empty(cls, frames: int, markers: int) -> Burst:
        """Return room for a number of frames, nan everywhere and without flags."""
        # Repeating bytes is four times as fast as filling rows with a record.
        rows = np.frombuffer(bytearray(_UNSEEN * (frames * markers)), dtype=SEEN)
        return cls(
            angle=np.full(frames, math.nan),
            ahead=np.zeros(frames),
            rows=rows.reshape(frames, markers),
        )

    @property
    def seen(self) -> Output:
        """The rows by field, as a view."""
        return by_field(self.rows, Output)
