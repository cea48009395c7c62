"""Nodes: the worst is told, silence is told, strangers are bounded."""

from winding_core.status import Level, Status
from winding_dashboard.state.health import Health, node_of


def report(name: str, level: Level = Level.OK, message: str = "") -> Status:
    return Status(name=name, level=level, message=message)


def test_row_tells_the_worst_and_everything_said() -> None:
    health = Health(["rig"])
    health.note(0.0, [report("rig", message="winding")])
    health.note(0.0, [report("rig: topics", Level.WARN, "refused a message")])
    (row,) = health.rows(1.0)
    assert (row.level, row.message) == (Level.WARN, "winding; refused a message")
    assert health.message("rig") == "winding"


def test_node_that_stops_talking_is_stale() -> None:
    health = Health(["rig"])
    health.note(0.0, [report("rig", Level.OK, "winding")])
    (row,) = health.rows(9.0)
    assert (row.level, row.message) == (Level.STALE, "silent for 9 s")


def test_node_that_was_never_heard_has_its_row() -> None:
    assert Health(["rig"]).rows(0.0)[0].message == "not heard yet"


def test_names_of_strangers_cannot_grow_without_end() -> None:
    health = Health(["rig"])
    for number in range(500):
        health.note(0.0, [report(f"stranger{number}"), report(f"rig: part{number}")])
    assert len(health.rows(0.0)) <= 25
    assert health.rows(0.0)[0].name == "rig"


def test_status_names_lead_to_their_node() -> None:
    names = ("rig", "rig: topics", "/winding/rig: topics", " rig : x")
    assert {node_of(name) for name in names} == {"rig"}
