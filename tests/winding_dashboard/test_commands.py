"""The order in which nodes are taken down, set and brought up."""

import asyncio
from collections.abc import Mapping

import pytest

from winding_dashboard.views import commands
from winding_dashboard.views.commands import ACTIVE, INACTIVE, UNCONFIGURED, CommandError

NODES = ("correction", "fem", "rig")
LEADS_TO = {
    ("configure", UNCONFIGURED): INACTIVE,
    ("activate", INACTIVE): ACTIVE,
    ("deactivate", ACTIVE): INACTIVE,
    ("cleanup", INACTIVE): UNCONFIGURED,
}


class Nodes:
    """Managed nodes by their state machine alone."""

    def __init__(self, state: str, refuses: str = "") -> None:
        self.states = dict.fromkeys(NODES, state)
        self.done: list[str] = []
        self._refuses = refuses

    async def state(self, node: str) -> str:
        return self.states[node]

    async def change(self, node: str, transition: str) -> None:
        if f"{node} {transition}" == self._refuses:
            raise CommandError(f"{node} refused")
        self.states[node] = LEADS_TO[transition, self.states[node]]
        self.done.append(f"{node} {transition}")

    async def set_parameters(self, node: str, values: Mapping[str, object]) -> None:
        assert self.states[node] == UNCONFIGURED
        self.done.append(f"{node} {dict(values)}")


def prepare(nodes: Nodes) -> list[str]:
    told: list[str] = []
    values = {name: {"case": 7} for name in NODES}
    asyncio.run(commands.prepare(nodes, NODES, values, told.append))
    return told


@pytest.mark.parametrize("before", [UNCONFIGURED, INACTIVE, ACTIVE])
def test_nodes_end_active_wherever_they_were(before: str) -> None:
    nodes = Nodes(before)
    assert len(prepare(nodes)) == 3
    assert set(nodes.states.values()) == {ACTIVE}


def test_machine_goes_down_first_and_comes_up_last() -> None:
    nodes = Nodes(ACTIVE)
    prepare(nodes)
    assert nodes.done[0] == "rig deactivate"
    assert nodes.done[-1] == "rig activate"


def test_machine_is_not_switched_on_when_a_node_refuses() -> None:
    nodes = Nodes(ACTIVE, refuses="fem configure")
    with pytest.raises(CommandError, match="fem refused"):
        prepare(nodes)
    assert nodes.states["rig"] != ACTIVE


def test_renewal_leaves_nodes_that_do_not_work_alone() -> None:
    nodes = Nodes(INACTIVE)
    nodes.states["fem"] = ACTIVE
    asyncio.run(commands.renew(nodes, NODES))
    assert nodes.done == ["fem deactivate", "fem activate"]


@pytest.mark.parametrize("phase", ["", "idle", "winding", "stopping", "finished", "emergency stop"])
def test_stopping_is_never_held_back_by_what_the_page_believes(phase: str) -> None:
    assert commands.out_of_phase(commands.STOP, phase) == ""
    assert commands.out_of_phase(commands.EMERGENCY_STOP, phase) == ""
