"""One snapshot is of one moment: newer ones count up, and all browsers get the same."""

import math
from typing import Any

from controlled_page import note_run
from simulated_page import Machine, fresh_state, served

from winding_core.lay.records import ControlMode
from winding_dashboard.drawings.cylinder_view import Sight
from winding_dashboard.page.snapshot import PERIOD, Wanted


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def source(clock: Clock) -> tuple[Any, Any]:
    state = fresh_state()
    note_run(state, 20.0, ControlMode.DRIVE)
    return state, served(state, Machine(), clock=clock).snapshots


def test_snapshot_is_made_once_for_everybody_who_asks_in_its_period() -> None:
    clock = Clock()
    state, snapshots = source(clock)
    first = snapshots.snapshot(Wanted())
    note_run(state, 21.0, ControlMode.DRIVE)
    clock.now += 0.5 * PERIOD
    assert snapshots.snapshot(Wanted()) == first
    clock.now += PERIOD
    later = snapshots.snapshot(Wanted())
    assert later["sequence"] == first["sequence"] + 1
    assert later["time"] > first["time"]


def test_what_one_browser_looks_at_is_its_own() -> None:
    _, snapshots = source(Clock())
    one = snapshots.snapshot(Wanted(marker=1))
    other = snapshots.snapshot(Wanted(marker=2, sight=Sight(yaw=0.5)))
    assert one["texts"]["chart-length-title"] == "S1, mm"
    assert other["texts"]["chart-length-title"] == "S2, mm"
    assert one["parts"]["cylinder"] != other["parts"]["cylinder"]
    same = {name: part for name, part in one["parts"].items() if name not in ("cylinder",)}
    assert {**other["parts"], **same}.keys() == one["parts"].keys()


def test_time_that_goes_back_is_told_by_the_count_of_resets() -> None:
    clock = Clock()
    state, snapshots = source(clock)
    before = snapshots.snapshot(Wanted())
    state.clear()
    note_run(state, 1.0, ControlMode.DRIVE)
    clock.now += 2.0 * PERIOD
    after = snapshots.snapshot(Wanted())
    assert after["time"] < before["time"]
    assert after["resets"] > before["resets"]


def test_age_of_what_was_seen_is_known_for_a_while() -> None:
    clock = Clock()
    _, snapshots = source(clock)
    seen = snapshots.snapshot(Wanted())
    clock.now += 3.0
    assert snapshots.age(seen["server"], seen["sequence"]) == 3.0
    for server, sequence in (
        ("other", 1),
        (seen["server"], 99),
        (seen["server"], "1"),
        (None, None),
    ):
        assert math.isinf(snapshots.age(server, sequence))


def test_silence_of_everything_is_an_age() -> None:
    clock = Clock()
    state, snapshots = source(clock)
    assert snapshots.snapshot(Wanted())["age"] is None
    state.tick(clock.now)
    clock.now += 0.5
    assert snapshots.snapshot(Wanted())["age"] == 0.0
    clock.now += 9.0
    assert snapshots.snapshot(Wanted())["age"] == 9.5
