"""What colcon and pip are told about each package: versions, licences, dependencies, data."""

import ast
import re
import sys
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
from catkin_pkg.changelog import Changelog, populate_changelog_from_rst
from catkin_pkg.package import parse_package

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "ros2_ws" / "src"
PACKAGES = sorted(path.parent.name for path in SOURCE.glob("*/package.xml"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

# Import name -> rosdep key, where rosdep knows the library on Ubuntu Noble.
ROSDEP_KEYS = {
    "cv2": "python3-opencv",
    "jinja2": "python3-jinja2",
    "joblib": "python3-joblib",
    "matplotlib": "python3-matplotlib",
    "numpy": "python3-numpy",
    "psutil": "python3-psutil",
    "rich": "python3-rich",
    "scipy": "python3-scipy",
    "sklearn": "python3-sklearn",
    "yaml": "python3-yaml",
}
# Import name -> name on PyPI, where they differ.
PYPI_NAMES = {
    "cv2": "opencv-python-headless",
    "jinja2": "Jinja2",
    "sklearn": "scikit-learn",
    "yaml": "PyYAML",
}
# Libraries of the project that rosdep does not know on Noble; pip brings them.
PYPI_ONLY = {
    "dask",
    "distributed",
    "mcap",
    "nicegui",
    "numba",
    "pyarrow",
    "rosbags",
    "safetensors",
    "torch",
    "typer",
    "zstandard",
}


def manifest(package: str) -> ET.Element:
    return ET.parse(SOURCE / package / "package.xml").getroot()


def text_of(package: str, tag: str) -> str:
    return manifest(package).findtext(tag, default="")


def depends(package: str) -> set[str]:
    return {item.text or "" for item in manifest(package).findall("depend")}


def setup_arguments(package: str) -> dict[str, Any]:
    """Return the literal arguments of a setup.py's one call of setup()."""
    tree = ast.parse((SOURCE / package / "setup.py").read_text(encoding="utf-8"))
    (call,) = (
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "setup"
    )
    arguments = {}
    for keyword in call.keywords:
        try:
            arguments[keyword.arg or ""] = ast.literal_eval(keyword.value)
        except ValueError:
            continue
    return arguments


def imported(package: str) -> set[str]:
    """Return the roots of what a package imports from outside itself and Python."""
    roots = set()
    for path in (SOURCE / package / package).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                roots |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                roots.add((node.module or "").split(".")[0])
    return roots - set(sys.stdlib_module_names) - {package}


def test_there_are_packages() -> None:
    assert {path.name for path in SOURCE.iterdir() if path.is_dir()} == set(PACKAGES)


@pytest.mark.parametrize("package", PACKAGES)
def test_manifest_setup_and_project_agree(package: str) -> None:
    root, setup = manifest(package), setup_arguments(package)
    assert root.get("format") == "3"
    assert text_of(package, "name") == package
    assert text_of(package, "version") == setup["version"] == PROJECT["version"]
    assert text_of(package, "license") == setup["license"] == PROJECT["license"]
    assert text_of(package, "description") == setup["description"]
    assert root.findtext("export/build_type") == "ament_python"


@pytest.mark.parametrize("package", PACKAGES)
def test_every_import_is_a_declared_dependency(package: str) -> None:
    wanted = imported(package) - PYPI_ONLY
    assert {ROSDEP_KEYS.get(name, name) for name in wanted} <= depends(package)
    required = set(setup_arguments(package)["install_requires"]) - {"setuptools"}
    assert required == imported(package) & PYPI_ONLY


@pytest.mark.parametrize("package", PACKAGES)
def test_no_library_is_declared_that_nobody_imports(package: str) -> None:
    libraries = {name for name in depends(package) if name.startswith("python3-")}
    assert libraries == {ROSDEP_KEYS[name] for name in imported(package) if name in ROSDEP_KEYS}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_library_is_in_the_root_project(package: str) -> None:
    extras = PROJECT["optional-dependencies"]
    wanted = [*PROJECT["dependencies"], *extras["dashboard"], *extras["cluster"]]
    pip = {re.split(r"[<>=!~\[]", text)[0] for text in wanted}
    libraries = imported(package) & (ROSDEP_KEYS.keys() | PYPI_ONLY)
    assert {PYPI_NAMES.get(name, name) for name in libraries} <= pip


@pytest.mark.parametrize("package", PACKAGES)
def test_data_files_of_the_package_are_installed(package: str) -> None:
    folder = SOURCE / package / package
    patterns = setup_arguments(package)["package_data"][""]
    installed = {path for pattern in patterns for path in folder.rglob(pattern)}
    data = {
        path
        for path in folder.rglob("*")
        if path.is_file() and path.suffix != ".py" and "__pycache__" not in path.parts
    }
    assert data <= installed


@pytest.mark.parametrize("package", PACKAGES)
def test_the_tools_of_ros_read_the_manifest_without_a_warning(package: str) -> None:
    warnings: list[str] = []
    parse_package(str(SOURCE / package), warnings=warnings).validate(warnings=warnings)
    assert warnings == []


@pytest.mark.parametrize("package", PACKAGES)
@pytest.mark.filterwarnings("ignore:nodes.Node.traverse:DeprecationWarning")
def test_the_tools_of_ros_read_the_changelog(package: str) -> None:
    text = (SOURCE / package / "CHANGELOG.rst").read_text(encoding="utf-8")
    # What a release makes of it (REP-132): the tools leave out what is forthcoming.
    released = f"{PROJECT['version']} (2026-01-01)"
    text = text.replace("Forthcoming\n-----------\n", f"{released}\n{'-' * len(released)}\n")
    changelog = populate_changelog_from_rst(Changelog(package), text)
    assert next(changelog.foreach_version())[0] == PROJECT["version"]
    assert changelog.get_content_of_version(PROJECT["version"])


@pytest.mark.parametrize("package", PACKAGES)
def test_changelog_has_its_heading(package: str) -> None:
    lines = (SOURCE / package / "CHANGELOG.rst").read_text(encoding="utf-8").splitlines()
    title = f"Changelog for package {package}"
    assert lines[:3] == ["^" * len(title), title, "^" * len(title)]
    assert lines[4] in ("Forthcoming", PROJECT["version"])
    assert lines[5] == "-" * len(lines[4])
