"""Nodes: the worst is told, silence is told, strangers are bounded."""

import pytest

from winding_dashboard.views.health import Health, Report, Severity, node_of


def report(name: str, severity: Severity = Severity.OK, message: str = "") -> Report:
    return Report(name=name, severity=severity, message=message)


def test_row_tells_the_worst_and_everything_said() -> None:
    health = Health(["rig"])
    health.note(0.0, [report("rig", message="winding")])
    health.note(0.0, [report("rig: topics", Severity.WARN, "refused a message")])
    (row,) = health.rows(1.0)
    assert (row.severity, row.message) == (Severity.WARN, "winding; refused a message")
    assert health.message("rig") == "winding"


def test_node_that_stops_talking_is_stale() -> None:
    health = Health(["rig"])
    health.note(0.0, [report("rig", Severity.OK, "winding")])
    (row,) = health.rows(9.0)
    assert (row.severity, row.message) == (Severity.STALE, "silent for 9 s")


def test_node_that_was_never_heard_has_its_row() -> None:
    assert Health(["rig"]).rows(0.0)[0].message == "not heard yet"


def test_names_of_strangers_cannot_grow_without_end() -> None:
    health = Health(["rig"])
    for number in range(500):
        health.note(0.0, [report(f"stranger{number}"), report(f"rig: part{number}")])
    assert len(health.rows(0.0)) <= 25
    assert health.rows(0.0)[0].name == "rig"


@pytest.mark.parametrize("name", ["rig", "rig: topics", "/winding/rig: topics", " rig : x"])
def test_status_names_lead_to_their_node(name: str) -> None:
    assert node_of(name) == "rig"
