"""`winding run --dashboard`, clicked through in a real browser, with a recording on and off."""

import json
import re
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from attended_run import NAMESPACE, AttendedRun, attended_run

from processes import until
from winding_recorder.bags.check import check
from winding_recorder.bags.contents import contents
from winding_recorder.bags.description import PARAMETERS
from winding_recorder.bags.reading import read_notes
from winding_supervisor.watch.event_log import read_events

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.timeout(900)]

# The run lasts 13 minutes unless it is ended: the operator's steps take two on a quick computer.
SPEED = 0.125
DURATION = "100"
FULL_SPEED = 1.74 * 0.97


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[AttendedRun]:
    folder = tmp_path_factory.mktemp("operated") / "run"
    options = ("--namespace", NAMESPACE, "--duration-s", DURATION, "--speed", str(SPEED))
    with attended_run(folder, *options) as attended:
        yield attended


@pytest.fixture(scope="module")
def motion(motion_of: Any) -> Any:
    return motion_of(NAMESPACE)


@pytest.fixture(scope="module")
def desk(new_tab: Any, run: AttendedRun) -> Any:
    return new_tab("desk", run.url)


def setup(desk: Any) -> Any:
    return desk.page.get_by_role("region", name="Next run")


def recording(desk: Any) -> Any:
    return desk.page.get_by_role("region", name="Recording")


def test_machine_waits_for_its_operator(desk: Any, motion: Any) -> None:
    desk.phase("ready")
    for name in ("Start", "Stop", "Reset", "EMERGENCY STOP"):
        desk.can(name)
    desk.page.locator("body").focus()
    reached = set()
    for _ in range(12):
        desk.page.keyboard.press("Tab")
        reached.add(desk.page.evaluate("document.activeElement.innerText"))
    assert {"Stop", "EMERGENCY STOP"} <= reached
    assert motion.samples[-1][1] == 0.0


def test_wrong_condition_is_refused_where_it_was_typed(desk: Any) -> None:
    setup(desk).get_by_label("Case").select_option("0")
    for label, value in (
        ("Cylinder diameter, mm", "3000"),
        ("Cable diameter, mm", "4"),
        ("Weight, N", "3.5"),
        ("Marker spacing, mm", "80"),
    ):
        setup(desk).get_by_label(label).fill(value)
    setup(desk).get_by_role("button", name="Prepare").click()
    setup(desk).get_by_text("Cylinder diameter, mm must be at most 2000, got 3000").wait_for()


def test_own_condition_is_prepared(desk: Any, pictures: Path) -> None:
    setup(desk).get_by_label("Cylinder diameter, mm").fill("30")
    desk.shoot(pictures, "own-condition")
    assert desk.misfits() == []
    setup(desk).get_by_role("button", name="Prepare").click()
    desk.answered("ready to wind an own condition")


def test_recording_begins_before_the_run(desk: Any, run: AttendedRun) -> None:
    recording(desk).get_by_role("button", name="Record", exact=True).click()
    desk.answered("recording: begun")
    desk.page.locator(".recording").wait_for(state="visible")
    assert (run.folder / "bag").is_dir()


def test_start_winds(desk: Any, motion: Any) -> None:
    desk.button("Start").click()
    desk.phase("winding")
    until(lambda: motion.samples[-1][1] > FULL_SPEED)
    recording(desk).get_by_text(re.compile(r"into bag: [1-9][\d ]+ messages, [\d.]+ MB")).wait_for()


def test_dead_page_comes_back_and_stops_nothing(desk: Any, run: AttendedRun, motion: Any) -> None:
    desk.page.get_by_label("Error of a length, %").fill("7.5")
    desk.page.get_by_role("button", name="Set", exact=True).click()
    desk.answered("limits: 7.5 %")
    before = until(run.page)
    before.kill()
    until(lambda: (page := run.page()) is not None and page.pid != before.pid)
    until(lambda: read_events(run.folder / "events.jsonl")[-1].what == "restarted")
    assert [event.what for event in read_events(run.folder / "events.jsonl")] == [
        "detected", "restarting", "restarted",
    ]  # fmt: skip
    assert {event.node for event in read_events(run.folder / "events.jsonl")} == {"dashboard"}
    # The browser complains of the connection that broke.
    desk.page.goto(run.url)
    desk.complaints.clear()
    desk.phase("winding")
    assert desk.page.get_by_label("Error of a length, %").input_value() == "7.5"
    assert motion.samples[-1][1] > FULL_SPEED


def end_recording(desk: Any) -> None:
    """End the recording of a machine that winds."""
    recording(desk).get_by_role("button", name="Stop recording").click()
    desk.page.get_by_text("Stop recording while the machine winds?").wait_for()
    desk.answer("Stop recording")
    desk.answered("messages")
    recording(desk).get_by_text("nothing is being recorded").wait_for()


def test_ending_a_recording_asks_and_leaves_a_whole_bag(desk: Any, run: AttendedRun) -> None:
    end_recording(desk)
    desk.phase("winding")
    assert check(run.folder / "bag").findings == []


def test_second_bag_is_recorded(desk: Any, run: AttendedRun, new_tab: Any, pictures: Path) -> None:
    recording(desk).get_by_role("button", name="Record", exact=True).click()
    recording(desk).get_by_text(re.compile("into bag-2: ")).wait_for()
    phone = new_tab("phone", run.url)
    for tab, name in ((desk, "desk"), (phone, "phone")):
        tab.phase("winding")
        tab.wait_for("document.querySelectorAll('.charts .curve').length >= 4")
        tab.page.locator(".recording").wait_for(state="visible")
        tab.shoot(pictures, f"operated-{name}")
        assert tab.misfits() == []
        assert tab.complaints == []
        assert tab.foreign_requests(run.url) == []
    phone.page.close()


def test_stop_holds_and_start_resumes(desk: Any, motion: Any) -> None:
    clicked = desk.click_time("Stop")
    slowed = until(
        lambda: [t for t, speed in tuple(motion.samples) if t > clicked and speed < FULL_SPEED]
    )
    # At an eighth of its speed the ramp takes 0.24 s of this to leave full speed.
    print(f"the cylinder slows {slowed[0] - clicked:.3f} s after the click on Stop")
    desk.phase("stopped")
    desk.button("Start").click()
    desk.phase("winding")
    until(lambda: motion.samples[-1][1] > FULL_SPEED)


def test_emergency_stop_and_reset_are_no_failures(desk: Any, run: AttendedRun, motion: Any) -> None:
    end_recording(desk)
    assert check(run.folder / "bag-2").findings == []
    desk.button("EMERGENCY STOP").click()
    desk.phase("e-stop")
    desk.button("Reset").click()
    desk.answer("Reset")
    desk.answered("start of a run")
    desk.phase("ready")
    desk.button("Start").click()
    desk.phase("winding")
    until(lambda: motion.samples[-1][1] > FULL_SPEED)
    recording(desk).get_by_role("button", name="Record", exact=True).click()
    recording(desk).get_by_text(re.compile("into bag-3: ")).wait_for()
    assert {event.node for event in read_events(run.folder / "events.jsonl")} == {"dashboard"}


def test_prepared_case_gets_a_bag_of_its_own(desk: Any, run: AttendedRun, motion: Any) -> None:
    desk.button("Stop").click()
    desk.phase("stopped")
    setup(desk).get_by_label("Case").select_option("5")
    setup(desk).get_by_label("Material law").select_option("neo_hookean")
    setup(desk).get_by_role("button", name="Prepare").click()
    desk.answer("Prepare")
    desk.answered("ready to wind case 5")
    desk.wait_for(
        "[...document.querySelectorAll('.nodes tbody tr')].slice(0, 4)"
        ".every(row => row.innerText.includes('active'))"
    )
    desk.button("Start").click()
    desk.phase("winding")
    until(lambda: motion.samples[-1][1] > FULL_SPEED)
    recording(desk).get_by_text(re.compile("into bag-4: ")).wait_for()
    # The lay is that of case 5, whose marker spacing is 100 mm.
    desk.wait_for("document.querySelectorAll('.camera polygon').length > 0")
    desk.wait_for("parseFloat(document.querySelector('#markers td.measured').innerText) > 90")
    assert check(run.folder / "bag-3").findings == []
    assert desk.complaints == []


# The runs are those that the page's tests have wound.
@pytest.mark.usefixtures("browser")
def test_ctrl_c_ends_a_session_and_every_run_has_its_report(run: AttendedRun, motion: Any) -> None:
    code, output = run.end()
    assert code == 0, output
    assert "Curve lengths of case 5" in output
    folders = [run.folder, run.folder / "run-2", run.folder / "run-3"]
    records = [json.loads((f / "run.json").read_text(encoding="utf-8")) for f in folders]
    assert [(record["case"], record["ended"]) for record in records] == [
        (0, "emergency stop"),
        (0, "stopped by the operator"),
        (5, "the operator ended the session"),
    ]
    assert len({record["identity"]["run_id"] for record in records}) == len(records)
    for folder, record in zip(folders, records, strict=True):
        assert (folder / "report" / "index.html").is_file()
        # Dates are whole seconds: that of the run's beginning, not of its delivery.
        began = datetime.fromisoformat(record["identity"]["date"]).timestamp()
        assert (folder / "run.json").stat().st_mtime - began >= record["wall_s"]
    bags = [run.folder / name for name in ("bag", "bag-2", "bag-3", "bag-4")]
    assert [line for line in output.splitlines() if line.startswith("bag: ")] == [
        f"bag: {bag}" for bag in bags
    ]
    for bag in bags:
        assert check(bag).findings == []
        counts = {topic.name: topic.messages for topic in contents(bag).topics}
        assert counts[f"/{NAMESPACE}/camera/image_raw"] > 0
        assert counts[f"/{NAMESPACE}/fem/prediction"] > 0
    cases = [json.loads(read_notes(bag)[f"{PARAMETERS}winding_rig"])["case"] for bag in bags]
    assert cases == [0, 0, 0, 5]
