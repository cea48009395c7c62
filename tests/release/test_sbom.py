"""The list of what a run's environment holds: the pinned versions, and nothing of this machine."""

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(1200)]


@pytest.fixture(scope="module")
def text(builds: Any, run: Callable[..., str]) -> str:
    """Return the list that is released with the wheel."""
    folder = builds[0].wheel.parent
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


def test_it_is_of_the_project_and_says_who_needs_what(text: str) -> None:
    record = json.loads(text)
    assert record["bomFormat"] == "CycloneDX"
    assert record["metadata"]["component"]["name"] == "cable-winding-twin"
    assert len(record["dependencies"]) > 50


def test_nothing_of_the_machine_and_the_moment_is_in_it(text: str) -> None:
    assert "serialNumber" not in json.loads(text)
    assert "timestamp" not in json.loads(text)["metadata"]
    assert not re.search(r"file://|/tmp/|/home/|/root/", text)
