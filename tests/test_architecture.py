"""The walls: who may import whom, and what only some rooms may touch."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "ros2_ws" / "src"
NODE_PACKAGES = {"cable_fem_node", "marker_tracker_node", "winding_rig_node", "correction_node"}
PACKAGES = NODE_PACKAGES | {
    "winding_core",
    "winding_study",
    "winding_dashboard",
    "winding_bringup",
}
ROS = {
    "rclpy",
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "lifecycle_msgs",
    "rcl_interfaces",
    "rosgraph_msgs",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
    "visualization_msgs",
}
# Which packages of the project each may import, itself aside.
ALLOWED = {
    "winding_core": set(),
    **{package: {"winding_core"} for package in NODE_PACKAGES},
    "winding_study": {"winding_core", "cable_fem_node", "correction_node"},
    "winding_dashboard": {"winding_core"},
    "winding_bringup": {"winding_core", "winding_study"},
}
MEANINGLESS = {"utils", "util", "common", "helpers", "helper", "manager", "base", "misc"}
FILES = sorted(path for package in PACKAGES for path in (SOURCE / package / package).rglob("*.py"))


def imports(path: Path) -> set[str]:
    """Return the full names of all modules that a file imports, wherever in the file."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} has a relative import"
            names.add(node.module or "")
    return names


def package_of(path: Path) -> str:
    return path.relative_to(SOURCE).parts[0]


def identifier(path: Path) -> str:
    return str(path.relative_to(SOURCE))


def test_every_package_has_its_description() -> None:
    for package in PACKAGES:
        for name in ("package.xml", "setup.py", "setup.cfg", f"resource/{package}"):
            assert (SOURCE / package / name).is_file(), f"{package} lacks {name}"


@pytest.mark.parametrize("path", FILES, ids=identifier)
def test_rooms_import_only_downwards(path: Path) -> None:
    package = package_of(path)
    rooms = {name.split(".")[0] for name in imports(path)} & PACKAGES - {package}
    allowed = ALLOWED[package]
    if package == "winding_bringup" and "commands" in path.parts:
        # A command is the door to its room: it may open it, lazily, and nothing else.
        allowed = PACKAGES
    assert rooms <= allowed


@pytest.mark.parametrize("path", FILES, ids=identifier)
def test_only_adapters_import_ros(path: Path) -> None:
    roots = {name.split(".")[0] for name in imports(path)}
    touches_ros = bool(roots & ROS) or any(name.startswith("winding_ros") for name in imports(path))
    adapter = (
        path.name in ("node.py", "__main__.py")
        or "ros" in path.relative_to(SOURCE).parts
        or package_of(path) == "winding_bringup"
    )
    assert adapter or not touches_ros


@pytest.mark.parametrize("path", FILES, ids=identifier)
def test_heavy_libraries_stay_in_their_rooms(path: Path) -> None:
    roots = {name.split(".")[0] for name in imports(path)}
    package = package_of(path)
    if "torch" in roots:
        assert package == "correction_node"
    if "cv2" in roots:
        camera = "camera" in path.relative_to(SOURCE).parts
        assert package == "marker_tracker_node" or (package == "winding_rig_node" and camera)
    if "nicegui" in roots:
        assert package == "winding_dashboard"


@pytest.mark.parametrize(
    ("one", "other"),
    [("winding_rig_node", "marker_tracker_node"), ("marker_tracker_node", "winding_rig_node")],
)
def test_renderer_and_tracker_share_no_projection(one: str, other: str) -> None:
    for path in (SOURCE / one / one).rglob("*.py"):
        assert not any(name.split(".")[0] == other for name in imports(path)), path


@pytest.mark.parametrize("path", FILES, ids=identifier)
def test_names_say_something(path: Path) -> None:
    assert path.stem not in MEANINGLESS
    assert not MEANINGLESS & set(path.relative_to(SOURCE).parts)


@pytest.mark.parametrize("path", FILES, ids=identifier)
def test_cores_have_no_clock_and_no_sleep(path: Path) -> None:
    if package_of(path) not in NODE_PACKAGES | {"winding_dashboard"} or path.name in (
        "node.py",
        "__main__.py",
    ):
        return
    calls = {
        f"{node.func.value.id}.{node.func.attr}"
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and isinstance(node.func.value, ast.Name)
    }
    assert not calls & {"time.time", "time.sleep", "time.monotonic", "time.perf_counter"}
