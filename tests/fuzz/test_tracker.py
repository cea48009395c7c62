"""Made-up pictures, cameras and encoders: the tracker answers, and never with an invalid marker."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from made_up import AXES
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, Image, RegionOfInterest

from marker_tracker_node import CameraPose, PinholeCamera, Tracker, TrackerConfig
from marker_tracker_node.ros.message_handler import TrackerHandler
from marker_tracker_node.ros.parameters import TrackerParameters
from winding_core.cable.cases import paper_case
from winding_core.machine.drive import DriveProfile
from winding_core.machine.readings import AxisReading
from winding_core.markers import MARKER_DTYPE, MarkerFlag, Markers
from winding_rig_node.camera import CablePath, CameraConfig, Renderer, Scene
from winding_rig_node.lay.known_lay import published_lay
from winding_ros import topics
from winding_ros.messages.camera import encode_image
from winding_ros.messages.cdr import serialised
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.rig import encode_joint_state
from winding_ros.messages.serialised import MessageError
from winding_ros.topic import Topic

fuzzed = settings.get_profile("files")
FREE_LENGTH = 0.198
DRIVE = DriveProfile()
CASE = paper_case(4)
# Where a run of 20 s comes to, and far beyond what a machine can do.
angles = st.one_of(
    st.none(), st.floats(-1.0, 40.0), st.floats(allow_nan=False, allow_infinity=False)
)
guides = st.one_of(
    st.none(), st.floats(-0.1, 0.2), st.floats(allow_nan=False, allow_infinity=False)
)


def require_valid(markers: Markers) -> None:
    """Fail for records that the tracker must not give."""
    if len(markers) == 0:
        return
    assert markers["id"].tolist() == list(range(CASE.marker_count + 1))
    wound = (markers["flags"] & MarkerFlag.NOT_WOUND) == 0
    for name in ("theta", "z", "s", "sigma_theta", "sigma_z", "x", "y"):
        assert np.isfinite(markers[name][wound]).all(), (name, markers)
        assert np.isnan(markers[name][~wound]).all(), (name, markers)
    for name in ("sigma_theta", "sigma_z"):
        assert (markers[name][wound] > 0.0).all(), (name, markers)
    assert (np.diff(markers["theta"][wound]) > 0.0).all(), markers
    assert (markers["flags"] < 64).all()
    assert (markers["flags"][~wound] == MarkerFlag.NOT_WOUND).all()


class Studio:
    """The rig's renderer, with what it films at hand."""

    def __init__(self) -> None:
        self.config = CameraConfig()
        self.renderer = Renderer(self.config)
        self.lay = published_lay(CASE, DRIVE, FREE_LENGTH, DRIVE.positions(20.0)[0])
        self.path = CablePath(theta=self.lay.path_theta, z=self.lay.path_z)
        known = ~np.isnan(self.lay.marker_theta)
        self.theta = self.lay.marker_theta[known]
        self.camera = PinholeCamera(**vars(self.config.calibration()))

    def frame(self, t: float, seed: int) -> np.ndarray:
        angle, guide = DRIVE.positions(t)
        scene = Scene(
            cylinder_radius=CASE.cylinder_radius,
            cable_radius=CASE.cable_radius,
            cylinder_angle=angle,
            path=self.path,
            marker_theta=self.theta,
            guide_z=guide,
            free_length=FREE_LENGTH,
        )
        return self.renderer.render(scene, np.random.default_rng(seed))

    def tracker(self) -> Tracker:
        config = TrackerConfig(
            cylinder_radius=CASE.cylinder_radius,
            cable_radius=CASE.cable_radius,
            marker_spacing=CASE.marker_spacing,
            marker_count=CASE.marker_count,
            expected_stretch=1.0 + CASE.nominal_stress / CASE.material.young,
            pose=CameraPose(position=self.config.position),
        )
        return Tracker(config, self.camera)


@pytest.fixture(scope="module")
def studio() -> Studio:
    return Studio()


def spoiled(frame: np.ndarray, how: str, seed: int, amount: float) -> np.ndarray:
    """Return a frame as a camera that fails in some way would give it."""
    rng = np.random.default_rng(seed)
    rows, columns, _ = frame.shape
    if how == "noise":
        return rng.integers(0, 256, frame.shape, dtype=np.uint8)
    if how == "constant":
        return np.full_like(frame, rng.integers(0, 256, 3, dtype=np.uint8))
    if how == "speckled":
        other = rng.integers(0, 256, frame.shape, dtype=np.uint8)
        return np.where(rng.random((rows, columns, 1)) < amount, other, frame)
    if how == "markers everywhere":
        # Marker colour: what is yellow-green in the frame, pasted in boxes.
        frame = frame.copy()
        for _ in range(int(40 * amount) + 1):
            row, column = rng.integers(0, rows), rng.integers(0, columns)
            high, wide = rng.integers(1, 40, 2)
            frame[row : row + high, column : column + wide] = (60, 215, 190)
        return frame
    if how == "shifted":
        return np.roll(frame, (int(amount * rows), seed % columns), axis=(0, 1))
    if how == "flipped":
        return np.ascontiguousarray(frame[::-1] if seed % 2 else frame[:, ::-1])
    if how == "dark":
        return (frame * (0.3 * amount)).astype(np.uint8)
    return frame


KINDS = [
    "whole", "whole", "noise", "constant", "speckled", "markers everywhere", "shifted", "flipped",
    "dark",
]  # fmt: skip
steps = st.lists(
    st.tuples(
        st.sampled_from(KINDS),
        st.integers(0, 9),
        st.floats(0.0, 1.0),
        # How far the run has come, whatever the encoder reads.
        st.floats(0.0, 20.0),
        st.one_of(st.just("right"), angles),
        guides,
    ),
    min_size=1,
    max_size=8,
)


@pytest.mark.slow
@fuzzed
@given(
    steps=steps, begun=st.sampled_from([0, 2, 12]), step=st.sampled_from([0.005, 0.005, 1.0, 1.0e6])
)
@example(
    steps=[("whole", 0, 0.0, 0.2, 1.0e300, -1.0e300), ("whole", 0, 0.0, 0.2, "right", None)],
    begun=12,
    step=0.005,
)
def test_any_picture_and_encoder(studio: Studio, steps: list[Any], begun: int, step: float) -> None:
    tracker, t = studio.tracker(), 0.0
    # The run begins well, so that there is a colour and a P0 to lose.
    for k in range(begun):
        t = 0.005 * k
        require_valid(tracker.track(studio.frame(t, k), t, *DRIVE.positions(t)))
    for how, seed, amount, place, angle, guide in steps:
        t += step
        frame = spoiled(studio.frame(place, seed), how, seed, amount)
        turned = DRIVE.positions(place)[0] if angle == "right" else angle
        require_valid(tracker.track(frame, t, turned, guide))
    require_valid(tracker.estimates())
    report = tracker.report()
    assert report.frames == begun + len(steps)
    assert 0 <= report.measured <= CASE.marker_count + 1


@fuzzed
@given(
    shape=st.lists(st.integers(0, 60), max_size=4),
    kind=st.sampled_from(["u1", "i1", "u2", "f4", "f8", "?"]),
    t=st.floats(),
)
def test_any_array(studio: Studio, shape: list[int], kind: str, t: float) -> None:
    tracker = studio.tracker()
    right = (*studio.camera.shape, 3)
    fits = tuple(shape) == right and kind == "u1" and math.isfinite(t)
    markers = tracker.track(np.zeros(shape, dtype=kind), t, 0.0)
    assert (len(markers) > 0) is fits
    assert sum(tracker.report().rejected.values()) == (0 if fits else 1)


number = st.one_of(st.floats(), st.floats(-1000.0, 1000.0), st.sampled_from([0.0, 500.0, 1e300]))
pixels = st.one_of(st.integers(0, 48), st.sampled_from([2**31, 2**32 - 1]))
infos = st.builds(
    lambda k, d, size, roi, binning, model: CameraInfo(
        k=k,
        d=d,
        width=size[0],
        height=size[1],
        roi=RegionOfInterest(x_offset=roi[0], y_offset=roi[1], width=roi[2], height=roi[3]),
        binning_x=binning,
        binning_y=binning,
        distortion_model=model,
    ),
    st.one_of(
        st.lists(number, min_size=9, max_size=9),
        st.tuples(st.floats(1.0, 1e4), number, number).map(
            lambda f: [f[0], 0.0, f[1], 0.0, f[0], f[2], 0.0, 0.0, 1.0]
        ),
    ),
    st.one_of(st.just([]), st.lists(number, min_size=5, max_size=5), st.lists(number, max_size=8)),
    st.one_of(st.just((48, 32)), st.tuples(pixels, pixels)),
    st.one_of(st.just((0, 0, 0, 0)), st.tuples(pixels, pixels, pixels, pixels)),
    st.integers(0, 3),
    st.sampled_from(["plumb_bob", "plumb_bob", "fisheye"]),
)
images = st.builds(
    lambda size, seed, encoding, stretch: (size, seed, encoding, stretch),
    st.one_of(
        st.just((32, 48)), st.just((16, 24)), st.tuples(st.integers(0, 50), st.integers(0, 50))
    ),
    st.integers(0, 9),
    st.sampled_from(["bgr8", "bgr8", "rgb8", "mono8", "yuv422"]),
    st.integers(-2, 2),
)
joints = st.tuples(st.floats(), st.floats(), st.floats(), st.floats())


def picture(t: float, size: tuple[int, int], seed: int, encoding: str, stretch: int) -> Image:
    frame = np.random.default_rng(seed).integers(0, 256, (*size, 3), dtype=np.uint8)
    message = deserialize_message(encode_image(t, frame), Image)
    message.encoding = encoding
    message.step = max(message.step + stretch, 0)
    return message


def sent(t: float, topic: Topic, content: Any) -> bytes:
    if topic is topics.IMAGE:
        return serialised(picture(t, *content))
    if topic is topics.JOINT_STATES:
        return encode_joint_state(t, AxisReading(**dict(zip(AXES, content, strict=True))))
    return serialised(content)


SMALL_CAMERA = CameraInfo(
    k=[50.0, 0.0, 24.0, 0.0, 50.0, 16.0, 0.0, 0.0, 1.0],
    width=48,
    height=32,
    distortion_model="plumb_bob",
)


@fuzzed
@given(
    messages=st.lists(
        st.one_of(
            infos.map(lambda info: (topics.CAMERA_INFO, info)),
            images.map(lambda image: (topics.IMAGE, image)),
            joints.map(lambda reading: (topics.JOINT_STATES, reading)),
        ),
        max_size=12,
    )
)
@example(
    messages=[
        (topics.CAMERA_INFO, SMALL_CAMERA),
        *[(topics.IMAGE, ((32, 48), 1, "bgr8", 0))] * 60,
    ]
)  # fmt: skip
def test_any_messages(messages: list[tuple[Topic, Any]]) -> None:
    handler = TrackerHandler(TrackerParameters(case=4))
    list(handler.begin(0.0))
    for k, (topic, content) in enumerate(messages):
        t = 0.005 * k
        try:
            answers = list(handler.take(topic, sent(t, topic, content)))
        except MessageError:
            continue
        for answer in answers:
            assert answer.topic is topics.TRACKED_MARKERS
            require_valid(decode_cloud(answer.message, MARKER_DTYPE)[1])
