"""The public interface: what it exports, how little an import costs, and how it refuses."""

import dataclasses
import inspect
import json
import subprocess
import sys
from importlib.metadata import version

import pytest

import cable_winding as cw

PROBE = """
import json, sys
import cable_winding
heavy = ("numpy", "numba", "scipy", "cv2", "torch", "rclpy", "rosbags", "pyarrow", "matplotlib")
print(json.dumps([name for name in heavy if name in sys.modules]))
"""


def test_an_import_brings_nothing_that_is_not_used() -> None:
    finished = subprocess.run(
        [sys.executable, "-c", PROBE], capture_output=True, text=True, check=True, timeout=60.0
    )
    assert json.loads(finished.stdout) == []


def test_the_version_is_that_of_the_project() -> None:
    assert cw.__version__ == version("cable-winding-twin")


@pytest.mark.parametrize("name", cw.__all__)
def test_a_public_name_is_documented_and_listed(name: str) -> None:
    thing = getattr(cw, name)
    assert name in dir(cw)
    if name == "FEATURES":
        return
    text = inspect.getdoc(thing)
    assert text
    if inspect.isclass(thing) and thing.__module__.startswith("cable_winding"):
        for field in dataclasses.fields(thing) if dataclasses.is_dataclass(thing) else ():
            assert f"{field.name}:" in text, field.name
    elif inspect.isfunction(thing):
        for parameter in inspect.signature(thing).parameters:
            assert f"{parameter}:" in text, parameter


def test_a_wrong_name_is_refused_as_python_does() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'predikt'"):
        cw.predikt  # noqa: B018
