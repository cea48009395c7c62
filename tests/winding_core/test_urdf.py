"""The URDF's kinematics are the project's own: marker, guide, load cell and camera."""

import math
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from marker_tracker_node.camera.pinhole import CameraPose
from winding_core.cable.condition import Condition
from winding_core.machine.axes import MachineAxes
from winding_core.machine.readings import ImageWindow
from winding_core.run_options import CameraPlacement
from winding_core.urdf import CAMERA, GUIDE, LOAD_CELL, MARKER, machine_urdf
from winding_dashboard.state.camera_view import CameraView

# Rounding of a handful of products of numbers of order one, a million times over.
EXACT = 1.0e-9
WHAT = Condition(case=4).resolved()
RNG = np.random.default_rng(3)


def frame(urdf: str, link: str, joints: dict[str, float]) -> np.ndarray:
    """Return the pose of a link in the root, shape (4, 4), by the URDF's rules."""
    root = ET.fromstring(urdf)
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


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_marker_and_guide_stand_where_the_axes_say(sign: float) -> None:
    axes = MachineAxes(
        cylinder_joint="drum", carriage_joint="slide", cylinder_scale=sign, carriage_scale=sign,
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
        matrix=np.diag([1.0, 1.0, 1.0]), distortion=np.zeros(5), window=ImageWindow(), width=640,
        height=480, position=np.array(placement.camera_position), tilt=np.array(tilt),
    )  # fmt: skip
    points = RNG.uniform([-0.02, -0.02, 0.0], [0.02, 0.02, 0.1], (20, 3))
    seen = (points - pose[:3, 3]) @ pose[:3, :3]
    np.testing.assert_allclose(seen[:, :2] / seen[:, 2:], page.pixels(points), atol=EXACT)


def test_every_link_hangs_on_the_frame_of_the_messages() -> None:
    root = ET.fromstring(machine_urdf(WHAT, MachineAxes(), CameraPlacement()))
    children = [item.get("link") for item in root.iterfind("joint/child")]
    links = {item.get("name") for item in root.iterfind("link")}
    assert links - set(children) == {"winder_axis"}
    assert len(children) == len(set(children)) == len(links) - 1
    for joint in root.iterfind("joint"):
        assert all(np.isfinite(numbers(item, "xyz")).all() for item in joint.iterfind("origin"))
