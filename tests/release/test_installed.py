"""The wheel in an environment of its own: it winds, its types are seen, its parts listed."""

import json
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from packaging.utils import canonicalize_name

from processes import ran

ROOT = Path(__file__).parents[2]
CONSUMER = Path(__file__).with_name("consumer.py")

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(1200)]


def environment(home: Path) -> dict[str, str]:
    """Return variables with which nothing of the clone or its environment is found."""
    kept = {name: value for name, value in os.environ.items() if name.startswith("PIP_")}
    return {**kept, "HOME": str(home), "PATH": "/usr/local/bin:/usr/bin:/bin"}


@pytest.fixture(scope="module")
def installed(
    first_build: Any, run: Callable[..., str], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """Return an environment with the wheel and what a run needs, from the package index."""
    folder = tmp_path_factory.mktemp("installed") / "environment"
    run([sys.executable, "-m", "venv", folder], ROOT)
    run(
        [
            folder / "bin" / "python", "-m", "pip", "install", "--quiet", "--no-compile",
            "--constraint", ROOT / "constraints.txt", f"{first_build.wheel}[ros]",
        ],
        folder,
        PYTHONPATH="",
    )  # fmt: skip
    return folder


@pytest.mark.processes
def test_a_run_needs_no_clone(installed: Path, tmp_path: Path) -> None:
    place = tmp_path / "empty"
    place.mkdir()
    words = ("run", "--case", 4, "--duration-s", 3, "--output", "left")
    ended = ran(installed / "bin" / "winding", *words, cwd=place, env=environment(tmp_path))
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert [path.name for path in place.iterdir()] == ["left"]
    assert json.loads((place / "left" / "run.json").read_text(encoding="utf-8"))["markers"]
    assert (place / "left" / "report" / "index.html").is_file()


def test_learning_and_the_page_are_not_installed(installed: Path, run: Callable[..., str]) -> None:
    listed = run([installed / "bin" / "python", "-m", "pip", "list", "--format=json"], installed)
    names = {item["name"].lower() for item in json.loads(listed)}
    assert "cable-winding-twin" in names
    assert not names & {"torch", "scikit-learn", "starlette", "pyarrow", "pytest"}


def mypy(installed: Path, folder: Path, text: str) -> str:
    """Return what mypy reports about a program in the environment."""
    (folder / "program.py").write_text(text, encoding="utf-8")
    ended = ran(
        *(sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "--config-file="),
        *("--python-executable", installed / "bin" / "python", "program.py"),
        cwd=folder, env=environment(folder),
    )  # fmt: skip
    assert not ended.stderr
    return ended.stdout


def test_types_are_seen_from_outside(installed: Path, tmp_path: Path) -> None:
    assert mypy(installed, tmp_path, CONSUMER.read_text(encoding="utf-8")) == ""


@pytest.mark.parametrize(
    ("right", "wrong", "complaint"),
    [
        ("case=case", 'case="four"', "[arg-type]"),
        ("case=case", "case_number=case", "[call-arg]"),
        ("predict(condition", "predict(case", "[arg-type]"),
        ("cw.predict(", "cw.predikt(", "[attr-defined]"),
        ("assert_type(condition.friction, float)", "condition.friction = 1.0", "[misc]"),
        ("-> cw.Prediction", "-> str", "[return-value]"),
    ],
    ids=["value", "keyword", "argument", "attribute", "frozen", "return"],
)
def test_misuse_is_an_error(
    installed: Path, tmp_path: Path, right: str, wrong: str, complaint: str
) -> None:
    text = CONSUMER.read_text(encoding="utf-8")
    assert right in text
    assert complaint in mypy(installed, tmp_path, text.replace(right, wrong))


def test_the_consumer_runs(installed: Path, tmp_path: Path) -> None:
    ended = ran(installed / "bin" / "python", CONSUMER, cwd=tmp_path, env=environment(tmp_path))
    assert ended.returncode == 0, ended.stderr
    assert 0.0 <= float(ended.stdout) < 0.01


def test_the_wheel_holds_launch_file_and_layouts(installed: Path, run: Any, tmp_path: Path) -> None:
    program = (
        "from importlib.resources import files\n"
        "home = files('winding_bringup')\n"
        "for name in ('launch', 'policy', 'viewers'):\n"
        "    print(*sorted(item.name for item in (home / name).iterdir()))\n"
    )
    assert run([installed / "bin" / "python", "-c", program], tmp_path).split() == [
        "twin.launch.py",
        "fastdds_localhost.xml",
        *("foxglove_layout.json", "winding.rviz"),
    ]


@pytest.fixture(scope="module")
def text(first_build: Any, run: Callable[..., str]) -> str:
    """Return the list that is released with the wheel."""
    folder = first_build.wheel.parent
    run([ROOT / "release" / "sbom.sh", sys.executable, folder], ROOT, PYTHONPATH="")
    (written,) = folder.glob("*.cdx.json")
    return written.read_text(encoding="utf-8")


def test_every_version_is_the_pinned_one(text: str) -> None:
    pins = dict(
        line.split("==")
        for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
        if "==" in line
    )
    pinned = {canonicalize_name(name): version for name, version in pins.items()}
    held = {
        canonicalize_name(one["name"]): one["version"] for one in json.loads(text)["components"]
    }
    held.pop("cable-winding-twin", None)
    assert {"numpy", "ros-rclpy", "opencv-python-headless"} <= held.keys()
    assert not held.keys() & {"pip", "setuptools-reproducible", "torch", "pytest"}
    assert {name: pinned.get(name) for name in held} == held


def test_it_is_of_the_project_and_lists_its_dependencies(text: str) -> None:
    record = json.loads(text)
    assert record["bomFormat"] == "CycloneDX"
    assert record["metadata"]["component"]["name"] == "cable-winding-twin"
    assert len(record["dependencies"]) > 50


def test_nothing_of_the_machine_and_the_moment_is_in_it(text: str) -> None:
    assert "serialNumber" not in json.loads(text)
    assert "timestamp" not in json.loads(text)["metadata"]
    assert not re.search(r"file://|/tmp/|/home/|/root/", text)
