"""What the doctor finds of the host, of filled-in addresses and of imports that fail."""

import os
import time
import tomllib
from collections.abc import Iterator
from email.message import Message
from pathlib import Path

import pytest

from winding_cli.doctor import host
from winding_cli.doctor.finding import Finding, Level
from winding_cli.doctor.host import ClockPair, judge_jumps, read_clocks
from winding_cli.doctor.installation import (
    DISTRIBUTION,
    STAND_IN,
    WHEELS,
    Imported,
    import_all,
    installed,
    judge_addresses,
    judge_python,
    judge_wheels,
)

OK, WARN, FAIL = Level.OK, Level.WARN, Level.FAIL
ROOT = Path(__file__).parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
TWIN = {"Repository": "https://forge.org/twin"}


def readings(jump: float, width: float = 0.0) -> Iterator[ClockPair]:
    """Yield readings every 10 ms; the wall clock jumps by `jump` seconds in the middle."""
    for k in range(20):
        t = 100.0 + 0.01 * k
        yield ClockPair(monotonic=t, wall=1.7e9 + t + (jump if k >= 10 else 0.0), width=width)


def test_clocks_that_run_together_do_not_jump() -> None:
    assert judge_jumps(readings(0.0)).level is Level.OK


@pytest.mark.parametrize("jump", [-3600.0, -0.02, 0.02, 5.0])
def test_clock_that_is_set_is_found_with_the_size_of_the_jump(jump: float) -> None:
    found = judge_jumps(readings(jump))
    assert found.level is Level.WARN
    assert float(found.found.split(" ms")[0]) == pytest.approx(1e3 * abs(jump), abs=0.01)


def test_reading_that_took_long_is_no_jump() -> None:
    """A process that gets no processor between two clocks sees them apart by as much."""
    assert judge_jumps(readings(0.02, width=0.04)).level is Level.OK


def test_reading_lies_in_the_middle_of_its_width() -> None:
    monotonic = iter((10.0, 10.5))
    pair = read_clocks(lambda: next(monotonic), lambda: 7.0)
    assert pair == ClockPair(monotonic=10.25, wall=7.0, width=0.5)
    assert read_clocks(time.monotonic, time.time).width >= 0.0


def test_disk_without_room_for_a_run_is_a_failure(small_disk: Path) -> None:
    found = host.judge_disk(small_disk, time.monotonic)
    assert [(f.check, f.level) for f in found] == [
        ("disk space", Level.FAIL),
        ("disk speed", Level.FAIL),
    ]
    assert all("No space left" in f.found for f in found)


def test_space_is_given_as_time_of_recording() -> None:
    found = [
        host.judge_space(Path("here"), int(seconds * host.RECORDED_PER_SECOND))
        for seconds in (19.0, 21.0, 3601.0)
    ]
    assert [f.level for f in found] == [Level.FAIL, Level.WARN, Level.OK]
    assert "19 s of recording" in found[0].found
    assert "60 min of recording" in found[2].found


def test_written_bytes_reach_the_disk_and_go_again(tmp_path: Path) -> None:
    readings = iter((10.0, 10.5))
    _, speed = host.judge_disk(tmp_path, lambda: next(readings), size=1_000_000)
    assert speed.found.startswith("2 MB/s written and synced")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("finding", "level", "found"),
    [
        (host.judge_resolution(1e-9), OK, "1 ns"),
        (host.judge_resolution(1e-4), WARN, ""),
        (host.judge_resolution(4e-3), FAIL, ""),
        (host.judge_date(1.7e9, 1.6e9), OK, ""),
        (host.judge_date(0.0, 7200.0), WARN, "2.0 h before the newest installed file"),
        (host.judge_synchronisation(None), OK, ""),
        (host.judge_synchronisation("yes"), OK, ""),
        (host.judge_synchronisation("no"), WARN, ""),
        (host.judge_speed(host.RECORDED_PER_SECOND), OK, ""),
        (host.judge_speed(5.0e6), WARN, "5 MB/s written and synced"),
        (host.judge_processors(2, 1.9), OK, ""),
        (host.judge_processors(2, 2.1), WARN, ""),
        (host.judge_processors(1, 0.0), WARN, ""),
        (host.judge_memory(3.0e9), OK, ""),
        (host.judge_memory(1.0e9), WARN, ""),
        (host.judge_open_files(50), FAIL, ""),
        (host.judge_open_files(100), WARN, ""),
        (host.judge_open_files(1024), OK, ""),
        (host.judge_receive_buffer(None), OK, ""),
        (host.judge_receive_buffer(65_536), WARN, ""),
        (host.judge_receive_buffer(212_992), OK, ""),
    ],
)
def test_the_host_is_held_against_a_run(finding: Finding, level: Level, found: str) -> None:
    assert finding.level is level
    assert finding.found.startswith(found)
    assert bool(finding.advice) is (level is not OK)


def stated(email: str | None, **sites: str) -> Message:
    """Return a distribution's metadata with these addresses."""
    facts = Message()
    if email is not None:
        facts["Maintainer-email"] = email
    for label, address in sites.items():
        facts["Project-URL"] = f"{label}, {address}"
    return facts


@pytest.mark.parametrize(
    ("email", "sites", "level", "found"),
    [
        (
            f"A <a@b{STAND_IN}>",
            TWIN | {"Issues": f"https://forge{STAND_IN}/issues"},
            Level.WARN,
            "to be filled in: maintainer, Issues",
        ),
        (None, TWIN, Level.WARN, "to be filled in: maintainer"),
        ("A <a@b.org>", TWIN, Level.OK, "maintainer, Repository"),
    ],
)
def test_addresses_that_are_to_be_filled_in_are_named(
    email: str | None, sites: dict[str, str], level: Level, found: str
) -> None:
    judged = judge_addresses(stated(email, **sites))
    assert (judged.level, judged.found) == (level, found)
    assert ("pyproject.toml" in judged.advice) is (level is Level.WARN)


def test_a_workspace_names_its_maintainer_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("winding_cli.doctor.installation.DISTRIBUTION", "not-installed-at-all")
    assert installed() is None
    assert judge_addresses(None).level is Level.OK


def test_the_finding_reads_what_the_project_states() -> None:
    assert PROJECT["name"] == DISTRIBUTION
    assert set(PROJECT["urls"]) == {"Repository", "Issues", "Security", "Documentation"}
    assert installed()["Name"] == DISTRIBUTION


def test_what_stands_in_stands_in_one_place_only() -> None:
    """Manifests are written from it; no page repeats it."""
    pages = [*ROOT.glob("*.md"), *ROOT.glob("*.cff"), *(ROOT / "docs").rglob("*.md")]
    assert len(pages) > 30
    repeated = [page.name for page in pages if "cable-winding-twin.example" in page.read_text()]
    assert repeated == []
    (maintainer,) = PROJECT["maintainers"]
    manifests = sorted((ROOT / "ros2_ws" / "src").glob("*/package.xml"))
    assert manifests
    for manifest in manifests:
        line = f'<maintainer email="{maintainer["email"]}">{maintainer["name"]}</maintainer>'
        assert line in manifest.read_text(encoding="utf-8")


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
