"""What colcon and pip read about each package: versions, dependencies, data, changelogs."""

import re
import sys
from configparser import ConfigParser
from pathlib import Path
from types import ModuleType

import pytest
from catkin_pkg.changelog import Changelog, populate_changelog_from_rst
from catkin_pkg.package import parse_package
from script import script

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "ros2_ws" / "src"
PACKAGES = sorted(path.parent.name for path in SOURCE.glob("*/package.xml"))
# Import name -> name on PyPI, where they differ.
PYPI_NAMES = {
    "cv2": "opencv-python-headless",
    "pinocchio": "pin",
    "jinja2": "Jinja2",
    "sklearn": "scikit-learn",
    "yaml": "PyYAML",
}
ROS_PACKAGE = re.compile(
    r"rclpy|\w+_msgs|std_srvs|rcl_interfaces|builtin_interfaces|ament_index_python"
    r"|domain_coordinator|launch(_ros)?"
)


@pytest.fixture(scope="module")
def generator() -> ModuleType:
    """Return the module that writes the packages' files."""
    return script(ROOT / "ros2_ws" / "package_files.py")


def changelog(package: str) -> str:
    return (SOURCE / package / "CHANGELOG.rst").read_text(encoding="utf-8")


def test_every_folder_is_a_package(generator: ModuleType) -> None:
    folders = {path.name for path in SOURCE.iterdir() if path.is_dir()}
    assert folders == set(PACKAGES) == set(generator.PACKAGES)


def test_generated_files_are_up_to_date(
    generator: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["package_files.py", "--check"])
    assert generator.main() == 0, capsys.readouterr().out


def test_a_list_of_packages_is_rewritten(generator: ModuleType) -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    # A name that stands in the lists alone.
    stale = text.replace("lay_control_node", "forgotten_node")
    assert stale.count("forgotten_node") >= len(generator.LISTS)
    assert generator.listed(stale) == text
    with pytest.raises(ValueError, match="no packages below"):
        generator.listed(text.replace("\npackages = ", "\nfolders = "))


def test_every_import_has_a_key_of_rosdep_or_pypi(generator: ModuleType) -> None:
    known = {*PACKAGES, *generator.ROSDEP_KEYS, *generator.PYPI_ONLY}
    unknown = [
        f"{package} imports {root}"
        for package in PACKAGES
        for root in sorted(generator.imported(package) - known)
        if not ROS_PACKAGE.fullmatch(root)
    ]
    assert unknown == []


@pytest.mark.slow
def test_every_library_is_in_the_root_project(generator: ModuleType) -> None:
    project = generator.PROJECT
    extras = project["optional-dependencies"]
    further = [
        text
        for name in ("dashboard", "cluster", "opcua", "arm", "train", "tables")
        for text in extras[name]
    ]
    wanted = [*project["dependencies"], *further]
    pip = {re.split(r"[<>=!~\[]", text)[0] for text in wanted}
    libraries = generator.ROSDEP_KEYS.keys() | generator.PYPI_ONLY
    missing = {
        PYPI_NAMES.get(root, root)
        for package in PACKAGES
        for root in generator.imported(package) & libraries
    } - pip
    assert missing == set()


def test_data_files_of_the_packages_are_installed() -> None:
    forgotten = []
    for package in PACKAGES:
        configuration = ConfigParser()
        configuration.read(SOURCE / package / "setup.cfg", encoding="utf-8")
        patterns = configuration["options.package_data"]["*"].split(", ")
        folder = SOURCE / package / package
        installed = {path for pattern in patterns for path in folder.rglob(pattern)}
        forgotten += [
            path
            for path in folder.rglob("*")
            if path.is_file()
            and path.suffix != ".py"
            and "__pycache__" not in path.parts
            and path not in installed
        ]
    assert forgotten == []


def test_no_link_of_a_package_leads_nowhere() -> None:
    links = [path for path in SOURCE.rglob("*") if path.is_symlink()]
    assert links
    assert [link for link in links if not link.exists()] == []


def test_the_tools_of_ros_read_the_manifests_without_a_warning() -> None:
    warnings: list[str] = []
    for package in PACKAGES:
        parse_package(str(SOURCE / package), warnings=warnings).validate(warnings=warnings)
    assert warnings == []


@pytest.mark.filterwarnings("ignore:nodes.Node.traverse:DeprecationWarning")
def test_the_tools_of_ros_read_the_changelogs(generator: ModuleType) -> None:
    version = generator.PROJECT["version"]
    for package in PACKAGES:
        # What a release makes of it (REP-132): the tools leave out what is forthcoming.
        released = f"{version} (2026-01-01)"
        text = changelog(package).replace(
            "Forthcoming\n-----------\n", f"{released}\n{'-' * len(released)}\n"
        )
        read = populate_changelog_from_rst(Changelog(package), text)
        assert next(read.foreach_version())[0] == version, package
        assert read.get_content_of_version(version), package


def test_changelogs_have_their_headings(generator: ModuleType) -> None:
    for package in PACKAGES:
        lines = changelog(package).splitlines()
        title = f"Changelog for package {package}"
        assert lines[:3] == ["^" * len(title), title, "^" * len(title)]
        assert lines[4] in ("Forthcoming", generator.PROJECT["version"]), package
        assert lines[5] == "-" * len(lines[4]), package
