"""Imports that work, fail, and take their process with them."""

import os
from pathlib import Path

from winding_cli.doctor.finding import Level
from winding_cli.doctor.installation import (
    WHEELS,
    Imported,
    import_all,
    judge_python,
    judge_wheels,
)


def test_python_is_one_that_ros_has_wheels_for() -> None:
    versions = ((3, 10, 9), (3, 11, 7), (3, 12, 0), (3, 13, 1), (3, 14, 0))
    levels = [judge_python(version).level for version in versions]
    assert levels == [Level.FAIL, Level.OK, Level.OK, Level.OK, Level.FAIL]


def test_imports_end_as_they_do_and_none_takes_the_others_along(tmp_path: Path) -> None:
    (tmp_path / "suicidal.py").write_text("import os\nos.abort()\n")
    (tmp_path / "broken.py").write_text("raise OSError('libnowhere.so:\\n no such file')\n")
    messages = tmp_path / "bare_msgs" / "msg"
    messages.mkdir(parents=True)
    # A package of messages without its compiled half, as rosidl writes one.
    (messages / "__init__.py").write_text(
        "class _Meta(type):\n"
        "    _TYPE_SUPPORT = None\n"
        "    @classmethod\n"
        "    def __import_type_support__(cls): pass\n"
        "class Bare(metaclass=_Meta): pass\n"
        "del _Meta\n"
    )
    names = ("broken", "suicidal", "bare_msgs", "nowhere", "std_msgs", "std_srvs", "psutil")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    found = import_all(names, os.environ | {"PYTHONPATH": path})
    assert found["broken"].error == "OSError: libnowhere.so: no such file"
    assert "suicidal" not in found
    assert found["bare_msgs"].error.endswith("bare_msgs has no type support for this middleware")
    assert found["nowhere"].error == "ModuleNotFoundError: No module named 'nowhere'"
    for name in ("std_msgs", "std_srvs", "psutil"):
        assert found[name].error == ""


def test_missing_wheel_is_a_failure_unless_the_graph_runs_without_it() -> None:
    fine = dict.fromkeys(WHEELS, Imported())
    assert {finding.level for finding in judge_wheels(fine)} == {Level.OK}
    gone = Imported(error="ModuleNotFoundError")
    found = {f.check: f for f in judge_wheels(fine | {"rclpy": gone, "uvicorn": gone})}
    assert found["wheel rclpy"].level is Level.FAIL
    assert "cable-winding-twin[ros]" in found["wheel rclpy"].advice
    assert found["wheel uvicorn"].level is Level.OK
    assert "cable-winding-twin[dashboard]" in found["wheel uvicorn"].found
    assert "winding train" in next(
        f.found for f in judge_wheels(fine | {"torch": gone}) if f.check == "wheel torch"
    )
    del fine["numba"]
    crashed = next(f for f in judge_wheels(fine) if f.check == "wheel numba")
    assert crashed.level is Level.FAIL
    assert crashed.found == "the import ended the whole process"


def test_build_that_is_not_the_tested_one_is_a_warning() -> None:
    fine = dict.fromkeys(WHEELS, Imported())
    found = judge_wheels(fine | {"torch": Imported(remark="a build for GPUs")})
    assert [f.check for f in found if f.level is Level.WARN] == ["wheel torch"]
