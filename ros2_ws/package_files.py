"""Write package.xml, setup.py, setup.cfg and the resource marker of every ROS package.

    python ros2_ws/package_files.py            write what is out of date
    python ros2_ws/package_files.py --check    name what is out of date, exit code 1

What a package depends on is what its files import; nobody edits these files by hand.
"""

import ast
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from string import Template

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "ros2_ws" / "src"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@dataclass(frozen=True, kw_only=True)
class Package:
    """What cannot be read off a package's files.

    Attributes:
        description: One sentence for the manifest.
        script: Console script, with the module whose `main` it calls.
        tests: Folders below tests/ that `colcon test` runs.
        runs: Packages that are started by name and not imported.
    """

    description: str
    script: tuple[str, str] | None = None
    tests: tuple[str, ...] = ()
    runs: tuple[str, ...] = ()


def _node(name: str, description: str) -> Package:
    return Package(description=description, script=(name, f"{name}.__main__"), tests=(name,))


NODES = (
    "cable_fem_node",
    "marker_tracker_node",
    "winding_rig_node",
    "correction_node",
    "lay_control_node",
)
PACKAGES = {
    "winding_core": Package(
        description="The condition that is wound, geometry, material laws, tables, markers.",
        tests=("winding_core",),
    ),
    "winding_ros": Package(
        description="Topics, the graph as data, message codecs, managed node, async client.",
        tests=("winding_ros", "security"),
    ),
    "cable_fem_node": _node(
        "cable_fem_node",
        "Explicit finite-element model of the wound cable, live and ahead of the run.",
    ),
    "marker_tracker_node": _node(
        "marker_tracker_node", "Measures marker positions from camera frames and encoder readings."
    ),
    "winding_rig_node": _node(
        "winding_rig_node", "Simulated winding machine with its sensors, camera and clock."
    ),
    "correction_node": _node(
        "correction_node", "Learned correction of predicted lengths, with error bounds."
    ),
    "lay_control_node": _node(
        "lay_control_node",
        "Lay programs, and the motion of guide and brake that lays the cable where they want it.",
    ),
    "winding_recorder": Package(
        description="Records, checks, recovers, plays and replays rosbag2 recordings.",
        tests=("winding_recorder",),
    ),
    "winding_plc_driver": _node(
        "winding_plc_driver", "Driver for a winding machine that a PLC runs, over OPC UA."
    ),
    "winding_supervisor": Package(
        description="Starts the graph's processes, drives their lifecycle, supervises a run.",
        tests=("winding_supervisor", "graph"),
        runs=(*NODES, "winding_dashboard"),
    ),
    "winding_reports": Package(
        description="Records and reports of runs, and where their time went.",
        tests=("winding_reports",),
    ),
    "winding_study": Package(
        description="Offline questions: the twelve cases, sweeps, identification, plans.",
        tests=("winding_study",),
    ),
    "winding_dashboard": _node(
        "winding_dashboard", "The operator's page: watches a winding graph and commands it."
    ),
    "winding_cli": Package(
        description="The command winding: run, predict, track, study, bag, doctor, conform.",
        script=("winding", "winding_cli.cli"),
        tests=("winding_cli",),
    ),
    "winding_verification": Package(
        description="Evidence: verification of the solver, experiments, studies, fault campaign.",
        tests=("faults",),
    ),
    "winding_bringup": Package(
        description="Launch file, access policy and viewer layouts of the winding graph.",
        tests=("docs/test_viewers.py",),
        runs=NODES,
    ),
}

# Import name -> rosdep key, where rosdep knows the library on Ubuntu Noble.
ROSDEP_KEYS = {
    "cryptography": "python3-cryptography",
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
# Import name -> name on PyPI of libraries that rosdep does not know on Noble.
PYPI_ONLY = {
    name: name
    for name in (
        "asyncua",
        "dask",
        "distributed",
        "mcap",
        "meshio",
        "numba",
        "pyarrow",
        "rosbags",
        "safetensors",
        "starlette",
        "torch",
        "typer",
        "uvicorn",
        "zstandard",
    )
}

_MANIFEST = Template("""\
<?xml version="1.0"?>
<?xml-model href="http://download.ros.org/schema/package_format3.xsd" \
schematypens="http://www.w3.org/2001/XMLSchema"?>
<!-- Written by ros2_ws/package_files.py. -->
<package format="3">
  <name>$name</name>
  <version>$version</version>
  <description>$description</description>
  <maintainer email="$email">$maintainer</maintainer>
  <license>$license</license>

$depends
  <test_depend>python3-pytest</test_depend>

  <export>
    <build_type>ament_python</build_type>
  </export>
</package>
""")
_SETUP = '''"""Installs the package for colcon; setup.cfg says what."""

from setuptools import setup

setup()
'''
_CONFIGURATION = Template("""\
# Written by ros2_ws/package_files.py.
[metadata]
name = $name
version = $version
description = $description
license = $license

[options]
packages = find:
zip_safe = False
install_requires =
$requires

[options.extras_require]
test = pytest

[options.package_data]
* = py.typed, data/*, trained/*/*, profiles/*, schemas/*, templates/*

[options.data_files]
share/ament_index/resource_index/packages = resource/$name
share/$name = package.xml
$data$scripts
[develop]
script_dir = $$base/lib/$name

[install]
install_scripts = $$base/lib/$name

[tool:pytest]
testpaths = $tests
addopts = -ra --import-mode=importlib
asyncio_default_fixture_loop_scope = function
timeout = 300
""")


def imported(name: str) -> set[str]:
    """Return the roots of what a package imports from outside itself and Python."""
    roots = set()
    for folder in (SOURCE / name / name, SOURCE / name / "launch"):
        for path in folder.rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Import):
                    roots |= {alias.name.split(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom):
                    roots.add((node.module or "").split(".")[0])
    return roots - set(sys.stdlib_module_names) - {name, ""}


def files(name: str) -> Iterator[tuple[Path, str]]:
    """Yield every generated file of a package with its text."""
    package, roots = PACKAGES[name], imported(name)
    facts = {
        "name": name,
        "version": PROJECT["version"],
        "description": package.description,
        "license": PROJECT["license"],
        "maintainer": PROJECT["maintainers"][0]["name"],
        "email": PROJECT["maintainers"][0]["email"],
    }
    needed = {ROSDEP_KEYS.get(root, root) for root in roots - PYPI_ONLY.keys()}
    depends = [f"  <depend>{key}</depend>" for key in sorted(needed)]
    depends += [
        f"  <exec_depend>{other}</exec_depend>" for other in package.runs if other not in needed
    ]
    requires = ["setuptools", *sorted(PYPI_ONLY[root] for root in roots & PYPI_ONLY.keys())]
    data = [
        f"share/{name}/{folder.name} = {', '.join(items)}"
        for folder in sorted((SOURCE / name).iterdir())
        if folder.is_dir()
        and folder.name in ("launch", "policy", "rviz", "viewers")
        and (
            items := sorted(
                f"{folder.name}/{item.name}" for item in folder.iterdir() if item.is_file()
            )
        )
    ]
    scripts = ""
    if package.script is not None:
        command, module = package.script
        scripts = f"\n[options.entry_points]\nconsole_scripts = {command} = {module}:main\n"
    home = SOURCE / name
    yield home / "package.xml", _MANIFEST.substitute(facts, depends="\n".join([*depends, ""]))
    yield home / "setup.py", _SETUP
    yield (
        home / "setup.cfg",
        _CONFIGURATION.substitute(
            facts,
            requires="\n".join(f"    {item}" for item in requires),
            data="".join(f"{line}\n" for line in data),
            scripts=scripts,
            tests=" ".join(f"../../../tests/{folder}" for folder in package.tests),
        ),
    )
    yield home / "resource" / name, ""


def main() -> int:
    """Write or check every file; return the exit code."""
    stale = [
        (path, text)
        for name in PACKAGES
        for path, text in files(name)
        if not path.is_file() or path.read_text(encoding="utf-8") != text
    ]
    for path, text in stale:
        if "--check" in sys.argv:
            print(f"{path.relative_to(ROOT)} is out of date: run {Path(__file__).name}")
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
    return int(bool(stale) and "--check" in sys.argv)


if __name__ == "__main__":
    sys.exit(main())
