"""A graph keeps to its host's loopback, unless its user wants it otherwise."""

import os
from pathlib import Path

import pytest

from winding_ros.environment import set_process_environment

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
SET = (RANGE, PROFILES, "ROS_DOMAIN_ID", "ROS_LOG_DIR", "RCUTILS_CONSOLE_OUTPUT_FORMAT")


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Take away what the command sets; the test's end brings back what the suite has set."""
    for name in SET:
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    return monkeypatch


@pytest.mark.parametrize("wanted", [None, "LOCALHOST"])
def test_this_host_means_the_loopback_and_no_shared_memory(
    bare: pytest.MonkeyPatch, tmp_path: Path, wanted: str | None
) -> None:
    if wanted:
        bare.setenv(RANGE, wanted)
    for _ in range(2):
        set_process_environment(7, tmp_path)
        # With LOCALHOST the middleware would add shared memory by itself.
        assert os.environ[RANGE] == "SYSTEM_DEFAULT"
    profile = Path(os.environ[PROFILES]).read_text(encoding="utf-8")
    assert "<address>127.0.0.1</address>" in profile
    assert "<useBuiltinTransports>false</useBuiltinTransports>" in profile
    assert "<type>SHM</type>" not in profile


@pytest.mark.parametrize(
    ("name", "value", "after"),
    [(RANGE, "SUBNET", ("SUBNET", None)), (PROFILES, "own.xml", ("LOCALHOST", "own.xml"))],
)
def test_what_the_user_has_set_stays(
    bare: pytest.MonkeyPatch, tmp_path: Path, name: str, value: str, after: tuple[str, str | None]
) -> None:
    bare.setenv(name, value)
    set_process_environment(7, tmp_path)
    assert (os.environ[RANGE], os.environ.get(PROFILES)) == after
