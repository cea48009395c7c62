"""Write package.xml, setup.py, setup.cfg and resource marker of every package, and their lists.

    python ros2_ws/package_files.py            write what is out of date
    python ros2_ws/package_files.py --check    name what is out of date, exit code 1

PACKAGES is the only list of the packages. The lists of `pyproject.toml` that name them (LISTS) are
rewritten from it; what a package depends on is what its files import.
"""

import ast
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from string import Template

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "ros2_ws" / "src"
PYPROJECT = ROOT / "pyproject.toml"
PROJECT = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]


@dataclass(frozen=True, kw_only=True)
class Package:
    """What cannot be read off a package's files.

    Attributes:
        description: One sentence for the manifest.
        floor: Of the layers of import-linter, 0 lowest: a package imports those of lower floors.
        script: Console script, with the module whose `main` it calls.
        tests: Folders below tests/ that `colcon test` runs.
        runs: Packages that are named as a text: started, or imported where they are installed.
    """

    description: str
    floor: int
    script: tuple[str, str] | None = None
    tests: tuple[str, ...] = ()
    runs: tuple[str, ...] = ()


def _node(name: str, description: str, *runs: str) -> Package:
    return Package(
        description=description,
        floor=2,
        script=(name, f"{name}.__main__"),
        tests=(name,),
        runs=runs,
    )


PACKAGES = {
    "winding_core": Package(
        description="The condition that is wound, geometry, material laws, tables, markers.",
        floor=0,
        tests=("winding_core",),
    ),
    "winding_ros": Package(
        description="Topics, the graph as data, message codecs, managed node, async client.",
        floor=1,
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
        floor=2,
        tests=("winding_recorder",),
    ),
    "winding_plc_driver": _node(
        "winding_plc_driver", "Driver for a winding machine that a PLC runs, over OPC UA."
    ),
    "winding_arm_driver": _node(
        "winding_arm_driver",
        "Driver for a winding machine whose guide a robot arm carries.",
        "control_msgs",
        "tf2_msgs",
    ),
    "winding_supervisor": Package(
        description="Starts the graph's processes, drives their lifecycle, supervises a run.",
        floor=4,
        tests=("winding_supervisor", "graph"),
        runs=("winding_dashboard",),
    ),
    "winding_reports": Package(
        description="Records of runs, their reports and traces.",
        floor=3,
        tests=("winding_reports",),
    ),
    "winding_study": Package(
        description="Offline questions: the twelve cases, sweeps, identification, plans.",
        floor=4,
        tests=("winding_study",),
    ),
    "winding_dashboard": Package(
        description="The operator's page: watches a winding graph and commands it.",
        floor=4,
        script=("winding_dashboard", "winding_dashboard.__main__"),
        tests=("winding_dashboard",),
    ),
    "cable_winding": Package(
        description="The public Python interface: predict, plan, track, identify, correct, read.",
        floor=5,
        tests=("cable_winding",),
    ),
    "winding_cli": Package(
        description="The command winding: run, predict, track, study, bag, doctor, conform.",
        floor=5,
        script=("winding", "winding_cli.cli"),
        tests=("winding_cli",),
    ),
    "winding_verification": Package(
        description="Evidence: verification of the solver, experiments, studies, fault campaign.",
        floor=6,
        tests=("winding_verification", "faults"),
    ),
    "winding_bringup": Package(
        description="Launch file, transport profile and viewer layouts of the winding graph.",
        floor=2,
        tests=("docs/test_viewers.py",),
    ),
}
# Started by name: by the supervisor, and by the launch file.
NODES = tuple(name for name in PACKAGES if name.endswith("_node"))
STARTS = {"winding_supervisor": NODES, "winding_bringup": NODES}
# Folders of a package that a workspace also installs to share/PACKAGE.
SHARED = ("launch", "policy", "viewers")
PRODUCT = tuple(name for name in PACKAGES if name not in ("cable_winding", "winding_verification"))


def _floors() -> Iterator[str]:
    """Yield the packages of each floor, highest first; those of one floor import none of it."""
    for floor in sorted({package.floor for package in PACKAGES.values()}, reverse=True):
        yield " | ".join(name for name, package in PACKAGES.items() if package.floor == floor)


# Lists of pyproject.toml: heading of the table, or name of the contract; key; value.
LISTS: tuple[tuple[str, str, Iterable[str] | str], ...] = (
    ("[tool.setuptools.packages.find]", "where", [f"ros2_ws/src/{name}" for name in PACKAGES]),
    ("[tool.ruff.lint.isort]", "known-first-party", PACKAGES),
    ("[tool.mypy]", "mypy_path", ":".join(f"ros2_ws/src/{name}" for name in PACKAGES)),
    ("[tool.mypy]", "packages", PACKAGES),
    ("[tool.importlinter]", "root_packages", PACKAGES),
    ('name = "Packages import downwards only"', "layers", tuple(_floors())),
    ('name = "No package imports the evidence or the public interface"', "source_modules", PRODUCT),
    ('name = "Supervisor and page know the nodes by name only"', "forbidden_modules", NODES),
    ('name = "No circle between the folders of a package"', "ancestors", PACKAGES),
    ("[tool.coverage.run]", "source_pkgs", PACKAGES),
)


def listed(text: str) -> str:
    """Return the text of pyproject.toml with every list of packages as PACKAGES has it.

    Raises:
        ValueError: The text has no such list.
    """
    for place, key, value in LISTS:
        begin = text.find(f"\n{place}\n")
        found = re.compile(rf"^{key} = (?:\[\n.*?^\]|[^\n]*)$", re.M | re.S).search(text, begin)
        if begin < 0 or found is None:
            raise ValueError(f"pyproject.toml has no {key} below {place}")
        if isinstance(value, str):
            shown = f'"{value}"'
        else:
            shown = "[\n" + "".join(f'    "{item}",\n' for item in value) + "]"
        text = f"{text[: found.start()]}{key} = {shown}{text[found.end() :]}"
    return text


# Import name -> rosdep key, where rosdep knows the library on Ubuntu Noble.
ROSDEP_KEYS = {
    "cryptography": "python3-cryptography",
    "cv2": "python3-opencv",
    "jinja2": "python3-jinja2",
    "joblib": "python3-joblib",
    "matplotlib": "python3-matplotlib",
    "numpy": "python3-numpy",
    "pinocchio": "pinocchio",
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
_SETUP = '''"""Installs the package for colcon, as setup.cfg declares it."""

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
* = py.typed, data/*, trained/*/*, profiles/*, schemas/*, templates/*, launch/*, policy/*, viewers/*

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
    for path in (SOURCE / name / name).rglob("*.py"):
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
        f"  <exec_depend>{other}</exec_depend>"
        for other in (*STARTS.get(name, ()), *package.runs)
        if other not in needed
    ]
    requires = ["setuptools", *sorted(PYPI_ONLY[root] for root in roots & PYPI_ONLY.keys())]
    data = [
        f"share/{name}/{folder.name} = "
        + ", ".join(sorted(f"{name}/{folder.name}/{item.name}" for item in folder.glob("*.*")))
        for folder in (SOURCE / name / name / shared for shared in SHARED)
        if folder.is_dir()
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
    everything = [file for name in PACKAGES for file in files(name)]
    everything.append((PYPROJECT, listed(PYPROJECT.read_text(encoding="utf-8"))))
    stale = [
        (path, text)
        for path, text in everything
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
