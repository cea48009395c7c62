"""The machine: joints become axes, bad readings are refused, its URDF has its kinematics."""

import math
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from axis_readings import axis_reading
from scipy.spatial.transform import Rotation

from marker_tracker_node.camera.pinhole import CameraPose
from winding_core.cable.condition import Condition
from winding_core.machine.axes import AxisReader, JointSample, MachineAxes, wrong_axis
from winding_core.machine.drive import DriveProfile
from winding_core.machine.incoming_readings import (
    LEAD_IN,
    LoadedReading,
    MotionStart,
    ReadingLimits,
    missing_joints,
)
from winding_core.machine.readings import AxisReading, ImageWindow
from winding_core.run_options import CameraPlacement
from winding_core.urdf import CAMERA, GUIDE, LOAD_CELL, MARKER, CarriageLimits, machine_urdf
from winding_dashboard.state.camera_view import CameraView

DRIVE = DriveProfile()
LIMITS = ReadingLimits(weight=4.0, angular_speed=DRIVE.angular_speed, feed_speed=DRIVE.feed_speed)
# Rounding of a handful of products of numbers of order one, a million times over.
EXACT = 1.0e-9
WHAT = Condition(case=4).resolved()
RNG = np.random.default_rng(3)


def reading(angle: float, position: float, omega: float = 0.0, feed: float = 0.0) -> AxisReading:
    return axis_reading(angle, position, speed=omega, feed=feed)


def wound(t: float, sample_rate: float, axes: MachineAxes) -> AxisReading:
    """Return the reading at t of a machine whose driver reports positions alone."""
    read = AxisReader(axes)
    times = np.arange(0.0, t + 0.5 / sample_rate, 1.0 / sample_rate)
    for now in times:
        angle, way = DRIVE.positions(float(now))
        found = read.read(
            JointSample(
                t=1.8e9 + float(now),
                cylinder=axes.cylinder_offset + angle / axes.cylinder_scale,
                carriage=axes.carriage_offset + way / axes.carriage_scale,
            )
        )
    return found


def test_a_standing_machine_is_at_the_origin_wherever_its_encoders_count_from() -> None:
    axes = MachineAxes(cylinder_scale=-1.0).standing_at([(37.2, 0.1), (37.2002, 0.1)])
    angle, position = axes.positions(37.2001, 0.1)
    assert (angle, position) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert axes.positions(36.2001, 0.15) == pytest.approx((1.0, 0.05))


@pytest.mark.parametrize("rate", [40.0, 100.0, 500.0, 2000.0])
@pytest.mark.parametrize("t", [0.5, 3.0])
def test_speeds_that_are_not_reported_are_the_slopes_of_positions(rate: float, t: float) -> None:
    axes = MachineAxes(cylinder_scale=math.radians(1.0), cylinder_offset=2131.0)
    omega, feed = DRIVE.speeds(t)
    found = wound(t, rate, axes)
    # Stamps since the epoch are whole multiples of 0.24 us, a tenth of a promille of 10 ms.
    assert found.angular_speed == pytest.approx(omega, rel=1e-3)
    assert found.feed_speed == pytest.approx(feed, rel=1e-3)


@pytest.mark.parametrize(
    ("angle", "way", "sentence"),
    [
        (-1.0, 1.0, "cylinder turned backwards"),
        (1.0, -1.0, "carriage moved backwards"),
        (math.degrees(1.0), 1.0, "cylinder_scale must give radians"),
        (1.0, 1000.0, "carriage_scale must give metres"),
    ],
)
def test_a_wrong_direction_or_unit_is_named(angle: float, way: float, sentence: str) -> None:
    theta, z = DRIVE.positions(1.0)
    assert wrong_axis(reading(theta, z), 1.0, DRIVE) == ""
    assert sentence in wrong_axis(reading(angle * theta, way * z), 1.0, DRIVE)


@pytest.mark.parametrize(
    ("share", "ahead", "lead"),
    [
        # A controlled carriage may go ahead of the cable, or backwards where it is wanted there.
        (1.0, 0.033, 0.033),
        (1.0, 0.0099, 0.033),
        (1.0, -0.033, -0.033),
        # A machine that is slower than the condition.
        (0.2, 0.0, 0.0),
    ],
)
def test_other_motion_is_no_wrong_axis(share: float, ahead: float, lead: float) -> None:
    theta, z = DRIVE.positions(1.0)
    assert wrong_axis(reading(share * theta, share * z + ahead), 1.0, DRIVE, lead) == ""
    assert "must give metres" in wrong_axis(reading(theta, 1000.0 * z), 1.0, DRIVE, abs(lead))


def test_swapped_axes_are_named() -> None:
    theta, z = DRIVE.positions(1.0)
    assert "are swapped" in wrong_axis(reading(z, theta), 1.0, DRIVE)


def test_a_run_begins_with_the_first_motion_and_half_a_second_of_standstill() -> None:
    start: MotionStart[LoadedReading] = MotionStart(awaited=True)
    passed = []
    for k in range(1000):
        t = 1.8e9 + 0.01 * k
        angle = 1e-4 * (-1) ** k if k < 900 else 0.01 * (k - 899)
        item = LoadedReading(t=t, reading=reading(angle, 0.0), tension=None)
        passed += [loaded.t - 1.8e9 for loaded in start.passed(item)]
    assert passed[0] == pytest.approx(9.0 - LEAD_IN, abs=0.011)
    assert passed == pytest.approx(list(np.arange(passed[0], 9.995, 0.01)), abs=1e-6)


def reading_at(t: float) -> AxisReading:
    return reading(*DRIVE.positions(t), *DRIVE.speeds(t))


def test_planned_run_is_never_refused_not_even_with_gaps() -> None:
    before = None
    for k in (0, 1, 2, 3, 1000, 1001, 1500, 5000):
        t = 1.0e-3 * k
        assert LIMITS.against_motion(t, reading_at(t), before) == ""
        before = (t, reading_at(t))


def test_speed_beyond_the_limit_is_named_with_it() -> None:
    fast = replace(reading_at(2.0), angular_speed=10.0)
    assert LIMITS.against_motion(2.0, fast, None) == (
        "cylinder must not be faster than 5.22, got 10"
    )


def test_jump_of_either_axis_is_refused() -> None:
    before = (2.0, reading_at(2.0))
    for field, name in (("cylinder_angle", "cylinder"), ("carriage_position", "carriage")):
        jumped = replace(reading_at(2.001), **{field: 5.0})
        assert LIMITS.against_motion(2.001, jumped, before).startswith(f"{name} jumped by ")


def test_tension_beyond_five_weights_is_refused() -> None:
    assert LIMITS.against_tension(19.9) == ""
    assert LIMITS.against_tension(20.1) == "tension must be at most 20 N, got 20.1 N"


ARRIVE = "messages/s arrive on it with"
OTHERS = "configured are wheel and sled: --cylinder-joint and --carriage-joint name others"


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        ([], ""),
        ([["wheel", "sled", "brake"]] * 80, ""),
        ([["joint1", "joint2"]] * 80, f"40 {ARRIVE} joints joint1, joint2; {OTHERS}"),
        ([["wheel"], ["sled"]] * 50,
         f"50 {ARRIVE} joints sled, wheel, one in each; each message needs both wheel and sled"),
        ([["wheel"]] * 10, f"5 {ARRIVE} joint wheel; {OTHERS}"),
        ([["a"], ["b"]] * 30,
         f"30 {ARRIVE} joints a, b, one in each; {OTHERS}; each message needs both"),
        ([[]] * 6, f"3 {ARRIVE} no joints; {OTHERS}"),
    ],
)  # fmt: skip
def test_missing_joints_are_described_by_arrivals(names: list[list[str]], sentence: str) -> None:
    axes = MachineAxes(cylinder_joint="wheel", carriage_joint="sled")
    assert missing_joints("it", names, 2.0, axes) == sentence


def frame(urdf: str, link: str, joints: dict[str, float]) -> np.ndarray:
    """Return the pose of a link in the root, shape (4, 4), by the URDF's rules."""
    root = ET.fromstring(urdf)
    joints = dict(joints)
    for item in root.iterfind("joint[mimic]"):
        rule = item.find("mimic")
        multiplier, offset = float(rule.get("multiplier", 1.0)), float(rule.get("offset", 0.0))
        joints[item.get("name", "")] = multiplier * joints[rule.get("joint", "")] + offset
    above = {item.find("child").get("link"): item for item in root.iterfind("joint")}  # type: ignore[union-attr]
    pose = np.eye(4)
    while link in above:
        joint = above[link]
        origin, axis = joint.find("origin"), joint.find("axis")
        assert origin is not None
        step = np.eye(4)
        step[:3, :3] = Rotation.from_euler("xyz", numbers(origin, "rpy")).as_matrix()
        step[:3, 3] = numbers(origin, "xyz")
        moved = np.eye(4)
        if axis is not None:
            way = numbers(axis, "xyz") * joints[joint.get("name") or ""]
            if joint.get("type") == "prismatic":
                moved[:3, 3] = way
            else:
                moved[:3, :3] = Rotation.from_rotvec(way).as_matrix()
        pose = step @ moved @ pose
        link = joint.find("parent").get("link") or ""  # type: ignore[union-attr]
    return pose


def numbers(element: ET.Element, key: str) -> np.ndarray:
    return np.array([float(word) for word in (element.get(key) or "").split()])


@pytest.mark.parametrize(
    ("turns", "moves"), [(1.0, 1.0), (-1.0, -1.0), (math.radians(-1.0), 1.0), (2.5, -1.0e-3)]
)
def test_marker_and_guide_stand_where_the_axes_place_them(turns: float, moves: float) -> None:
    axes = MachineAxes(
        cylinder_joint="drum", carriage_joint="slide", cylinder_scale=turns, carriage_scale=moves,
        cylinder_offset=37.2, carriage_offset=0.1,
    )  # fmt: skip
    urdf = machine_urdf(WHAT, axes)
    rho, span = WHAT.case.centreline_radius, WHAT.free_length
    for drum, slide in RNG.uniform([-50.0, -0.5], [50.0, 0.5], (20, 2)):
        joints = {"drum": drum, "slide": slide}
        angle, way = axes.positions(drum, slide)
        # P0 stands at azimuth Theta on the centreline, the guide a span before the contact line.
        marker = [rho * math.cos(angle), rho * math.sin(angle), 0.0]
        np.testing.assert_allclose(frame(urdf, MARKER, joints)[:3, 3], marker, atol=EXACT)
        np.testing.assert_allclose(frame(urdf, GUIDE, joints)[:3, 3], [rho, -span, way], atol=EXACT)
        cell = frame(urdf, LOAD_CELL, joints)
        np.testing.assert_allclose(cell[:3, 3], [rho, -span, way], atol=EXACT)
        np.testing.assert_allclose(cell[:3, 0], [0.0, 1.0, 0.0], atol=EXACT)


@pytest.mark.parametrize(
    "tilt", [(0.0, 0.0, 0.0), (1e-7, -2e-7, 0.0), *RNG.uniform(-0.5, 0.5, (8, 3))]
)
def test_the_camera_looks_as_tracker_and_page_project(tilt: tuple[float, ...]) -> None:
    placement = CameraPlacement(camera_position=[0.3, -0.02, 0.07], camera_tilt=list(tilt))
    pose = frame(machine_urdf(WHAT, MachineAxes(), placement), CAMERA, {})
    tracker = CameraPose(position=(0.3, -0.02, 0.07), tilt=tuple(tilt))  # type: ignore[arg-type]
    np.testing.assert_allclose(pose[:3, :3].T, tracker.axes, atol=EXACT)
    page = CameraView(
        matrix=np.diag([1.0, 1.0, 1.0]),
        distortion=np.zeros(5),
        window=ImageWindow(),
        width=640,
        height=480,
        position=np.array(placement.camera_position),
        tilt=np.array(tilt),
    )
    points = RNG.uniform([-0.02, -0.02, 0.0], [0.02, 0.02, 0.1], (20, 3))
    seen = (points - pose[:3, 3]) @ pose[:3, :3]
    np.testing.assert_allclose(seen[:, :2] / seen[:, 2:], page.pixels(points), atol=EXACT)


@pytest.mark.parametrize(
    ("axes", "joint", "ends"),
    [
        (MachineAxes(), "carriage_joint", (-0.05, 0.4)),
        (MachineAxes(carriage_scale=-1.0, carriage_offset=0.3), "carriage_joint", (-0.1, 0.35)),
        (MachineAxes(carriage_scale=-1.0e-3, carriage_offset=812.0), "carriage_joint_in_m",
         (-0.05, 0.4)),
    ],
)  # fmt: skip
def test_the_carriage_is_held_to_its_travel_and_speed(
    axes: MachineAxes, joint: str, ends: tuple[float, float]
) -> None:
    limits = CarriageLimits(low=-0.05, high=0.4, speed=0.033)
    root = ET.fromstring(machine_urdf(WHAT, axes, carriage=limits))
    limit = root.find(f"joint[@name='{joint}']/limit")
    assert [float(limit.get(end, "")) for end in ("lower", "upper")] == pytest.approx(ends)
    assert float(limit.get("velocity", "")) == 0.033


def test_bodies_have_masses_that_a_rigid_body_can_have() -> None:
    root = ET.fromstring(machine_urdf(WHAT, MachineAxes(carriage_scale=1.0e-3), CameraPlacement()))
    for link in root.iterfind("link"):
        if link.get("name") == "winder_axis":
            continue
        mass, tensor = link.find("inertial/mass"), link.find("inertial/inertia")
        assert float(mass.get("value", "")) > 0.0
        x, y, z = (float(tensor.get(name, "")) for name in ("ixx", "iyy", "izz"))
        assert min(x, y, z) > 0.0
        # No moment exceeds the sum of the others.
        assert 2.0 * max(x, y, z) <= x + y + z
    drum = root.find("link[@name='cylinder']")
    shapes = [drum.find(f"{part}/geometry/cylinder") for part in ("visual", "collision")]
    assert shapes[0].attrib == shapes[1].attrib
    radius, length = (float(shapes[0].get(name, "")) for name in ("radius", "length"))
    tensor, mass = drum.find("inertial/inertia"), drum.find("inertial/mass")
    per_mass = {name: float(tensor.get(name, "")) / float(mass.get("value", ""))
                for name in ("ixx", "izz")}  # fmt: skip
    assert per_mass == pytest.approx(
        {"ixx": (3.0 * radius**2 + length**2) / 12.0, "izz": radius**2 / 2.0}
    )


def test_every_link_hangs_on_the_frame_of_the_messages() -> None:
    axes = MachineAxes(cylinder_scale=math.pi, carriage_scale=1.0e-3)
    root = ET.fromstring(machine_urdf(WHAT, axes, CameraPlacement()))
    children = [item.get("link") for item in root.iterfind("joint/child")]
    links = {item.get("name") for item in root.iterfind("link")}
    assert links - set(children) == {"winder_axis"}
    assert len(children) == len(set(children)) == len(links) - 1
    origins = root.findall("joint/origin")
    assert origins
    assert all(np.isfinite(numbers(origin, "xyz")).all() for origin in origins)
