"""The Python that runs this and the wheels that the graph imports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from winding_cli.doctor.finding import Finding, fail, ok, warn

PYTHONS = ((3, 11), (3, 12))
_ROS = "ros"
_DASHBOARD = "dashboard"


@dataclass(frozen=True, kw_only=True)
class Wheel:
    """Something that has to be importable.

    Attributes:
        module: What is imported.
        distribution: Name under which its version is kept.
        extra: Extra of the project that brings it; empty for those that always come.
        needed: Whether the graph runs without it.
    """

    module: str
    distribution: str
    extra: str = ""
    needed: bool = True

    @property
    def check(self) -> str:
        """Name of the finding."""
        return f"wheel {self.module}"


@dataclass(frozen=True, kw_only=True)
class Imported:
    """How an import ended.

    Attributes:
        version: What its distribution says; empty when nothing does.
        error: Why it failed; empty when it did not.
        remark: What speaks against this build of it.
    """

    version: str = ""
    error: str = ""
    remark: str = ""


WHEELS = (
    Wheel(module="rclpy", distribution="rclpy", extra=_ROS),
    *(
        Wheel(module=name, distribution=name, extra=_ROS)
        for name in (
            "diagnostic_msgs",
            "geometry_msgs",
            "lifecycle_msgs",
            "rosgraph_msgs",
            "sensor_msgs",
            "std_msgs",
            "std_srvs",
            "visualization_msgs",
        )
    ),
    Wheel(module="numpy", distribution="numpy"),
    Wheel(module="scipy", distribution="scipy"),
    Wheel(module="numba", distribution="numba"),
    Wheel(module="cv2", distribution="opencv-python-headless"),
    Wheel(module="torch", distribution="torch"),
    Wheel(module="rosbags", distribution="rosbags"),
    Wheel(module="mcap", distribution="mcap"),
    Wheel(module="nicegui", distribution="nicegui", extra=_DASHBOARD, needed=False),
)


def judge_python(version: tuple[int, ...]) -> Finding:
    """Return whether the wheels of ROS exist for this Python."""
    text = ".".join(map(str, version[:3]))
    if tuple(version[:2]) in PYTHONS:
        return ok("python", text)
    wanted = " or ".join(f"{major}.{minor}" for major, minor in PYTHONS)
    return fail("python", text, f"make a virtual environment of Python {wanted}")


def judge_wheels(imported: Mapping[str, Imported]) -> list[Finding]:
    """Return one finding for each wheel.

    Args:
        imported: How each import ended, by module; what is missing ended the importing process.
    """
    crashed = Imported(error="the import ended the whole process")
    return [_judge(wheel, imported.get(wheel.module, crashed)) for wheel in WHEELS]


def _judge(wheel: Wheel, result: Imported) -> Finding:
    project = "cable-winding-twin" + (f"[{wheel.extra}]" if wheel.extra else "")
    install = f"pip install '{project}'"
    if result.error and wheel.needed:
        if wheel.extra == _ROS:
            install += ", or source /opt/ros/jazzy/setup.bash"
        return fail(wheel.check, result.error, install)
    if result.error:
        return ok(wheel.check, f"not there; only `winding dashboard` needs it ({install})")
    version = result.version or "version unknown"
    if result.remark:
        return warn(wheel.check, f"{version}: {result.remark}", install)
    return ok(wheel.check, version)
