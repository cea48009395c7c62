"""What only some places may touch, how large a file may grow, and which names say nothing.

Who may import whom between packages and folders: the contracts of import-linter in pyproject.toml.
Clocks, sleep and relative imports: what ruff bans in the same file. Both are part of `make lint`.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "ros2_ws" / "src"
FILES = sorted(SOURCE.glob("*/*/**/*.py"))
LINES_OF_A_FILE = 450
FILES_OF_A_FOLDER = 20
SHARE_OF_A_PACKAGE = 0.2
MEANINGLESS = {"utils", "util", "common", "helpers", "helper", "manager", "base", "misc"}

ROS = re.compile(
    r"rclpy|rcl_interfaces|builtin_interfaces|ament_index_python|domain_coordinator|launch(_ros)?"
    r"|std_srvs|\w+_msgs|winding_ros"
)
# Library -> where else than in the evidence it may be imported, as a path below the sources.
PLACES = {
    ROS: re.compile(
        r"(winding_ros|winding_supervisor|winding_cli)/"
        r"|winding_recorder/winding_recorder/(live|playback)/"
        r"|winding_bringup/winding_bringup/launch/"
        r"|(\w+_node|winding_dashboard|winding_(plc|arm)_driver)/\w+/(node\.py|__main__\.py|ros/)"
    ),
    re.compile(r"torch"): re.compile(r"correction_node/"),
    re.compile(r"cv2"): re.compile(
        r"marker_tracker_node/|winding_rig_node/winding_rig_node/camera/"
    ),
    re.compile(r"starlette|uvicorn"): re.compile(
        r"winding_dashboard/winding_dashboard/(web/|__main__\.py)"
    ),
    re.compile(r"asyncua"): re.compile(r"winding_plc_driver/winding_plc_driver/opcua/"),
    re.compile(r"pinocchio"): re.compile(r"winding_core/winding_core/arm/kinematics\.py"),
}


def imports(path: Path) -> Iterator[ast.Import | ast.ImportFrom]:
    """Yield the imports of a file, wherever in the file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node


def roots(path: Path) -> set[str]:
    """Return the first names of all modules that a file imports."""
    return {
        name.split(".")[0]
        for node in imports(path)
        for name in (
            [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else [alias.name for alias in node.names]
        )
    }


def place(path: Path) -> str:
    return path.relative_to(SOURCE).as_posix()


def lines(path: Path) -> int:
    return len(path.read_text(encoding="utf-8").splitlines())


def test_ros_and_heavy_libraries_stay_in_their_places() -> None:
    strayed = [
        f"{place(path)} imports {root}"
        for path in FILES
        for root in sorted(roots(path))
        for library, allowed in PLACES.items()
        if library.fullmatch(root) and not allowed.match(place(path))
        if not place(path).startswith("winding_verification/")
    ]
    assert strayed == []


def test_bringup_holds_no_logic() -> None:
    folder = SOURCE / "winding_bringup" / "winding_bringup"
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*.py")}
    assert files == {"__init__.py", "launch/twin.launch.py"}
    assert roots(folder / "__init__.py") == set()


def test_no_file_has_a_meaningless_name() -> None:
    nothing = [
        place(path)
        for path in FILES
        if MEANINGLESS & {*path.relative_to(SOURCE).with_suffix("").parts}
    ]
    assert nothing == []


def test_no_file_is_longer_than_one_idea() -> None:
    long = {place(path): lines(path) for path in FILES if lines(path) > LINES_OF_A_FILE}
    assert long == {}


def test_no_folder_is_a_heap_of_files() -> None:
    counts = Counter(place(path.parent) for path in FILES)
    large = {folder: count for folder, count in counts.items() if count > FILES_OF_A_FOLDER}
    assert large == {}


def test_no_package_outgrows_the_others() -> None:
    sizes: dict[str, int] = {}
    for path in FILES:
        package = path.relative_to(SOURCE).parts[0]
        sizes[package] = sizes.get(package, 0) + lines(path)
    total = sum(sizes.values())
    large = {name: size for name, size in sizes.items() if size > SHARE_OF_A_PACKAGE * total}
    assert large == {}, f"of {total}"
