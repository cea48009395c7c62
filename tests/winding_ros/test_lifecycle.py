"""The order in which nodes are taken down, set and brought up, through lost answers."""

import asyncio
from typing import Any

import pytest
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParametersAtomically

from winding_ros.client.lifecycle import ACTIVATE, CLEANUP, CONFIGURE, DEACTIVATE, LifecycleDriver
from winding_ros.graph import GraphError

NODES = ("correction", "fem", "rig")
NAMES = {
    CONFIGURE: "configure",
    ACTIVATE: "activate",
    DEACTIVATE: "deactivate",
    CLEANUP: "cleanup",
}
UNCONFIGURED = State.PRIMARY_STATE_UNCONFIGURED
INACTIVE = State.PRIMARY_STATE_INACTIVE
ACTIVE = State.PRIMARY_STATE_ACTIVE
LEADS_TO = {
    (CONFIGURE, UNCONFIGURED): INACTIVE,
    (ACTIVATE, INACTIVE): ACTIVE,
    (DEACTIVATE, ACTIVE): INACTIVE,
    (CLEANUP, INACTIVE): UNCONFIGURED,
}


class Nodes:
    """Answers as the services of managed nodes do; one may refuse, or its answer get lost."""

    def __init__(self, state: int, *, refuses: str = "", loses: str = "") -> None:
        self.states = dict.fromkeys(NODES, state)
        self.done: list[str] = []
        self._refuses, self._loses = refuses, loses

    def ready(self, service: type, name: str) -> bool:
        return True

    async def call(self, service: type, name: str, request: Any, timeout: float) -> Any:
        _, namespace, node, _ = name.split("/")
        assert namespace == "cell"
        if service is GetState:
            return GetState.Response(current_state=State(id=self.states[node]))
        assert service is SetParametersAtomically
        assert self.states[node] == UNCONFIGURED
        self.done.append(f"{node} set")
        response = SetParametersAtomically.Response()
        response.result.successful = True
        return response

    async def try_call(self, service: type, name: str, request: Any, timeout: float) -> Any:
        assert service is ChangeState
        node, transition = name.split("/")[2], request.transition.id
        word = f"{node} {NAMES[transition]}"
        if word == self._refuses:
            return ChangeState.Response(success=False)
        self.states[node] = LEADS_TO[transition, self.states[node]]
        self.done.append(word)
        return None if word == self._loses else ChangeState.Response(success=True)


def driver(nodes: Nodes) -> LifecycleDriver:
    async def reason(node: str) -> str:
        return f"{node} is tired"

    return LifecycleDriver(nodes, "cell", reason)  # type: ignore[arg-type]


def rebuild(nodes: Nodes) -> list[str]:
    stages: list[str] = []
    asyncio.run(driver(nodes).rebuild(NODES, {name: {"case": 7} for name in NODES}, stages.append))
    return stages


def test_nodes_end_active_wherever_they_were() -> None:
    for before in (UNCONFIGURED, INACTIVE, ACTIVE):
        nodes = Nodes(before)
        assert len(rebuild(nodes)) == 3
        assert set(nodes.states.values()) == {ACTIVE}


def test_machine_goes_down_first_and_comes_up_last() -> None:
    nodes = Nodes(ACTIVE)
    rebuild(nodes)
    assert nodes.done[0] == "rig deactivate"
    assert nodes.done[-1] == "rig activate"


def test_machine_is_not_switched_on_when_a_node_refuses() -> None:
    nodes = Nodes(ACTIVE, refuses="fem configure")
    with pytest.raises(GraphError, match="fem: fem is tired"):
        rebuild(nodes)
    assert nodes.states["rig"] != ACTIVE


def test_state_tells_what_became_of_a_transition_without_an_answer() -> None:
    nodes = Nodes(INACTIVE, loses="fem activate")
    asyncio.run(driver(nodes).change("fem", Transition.TRANSITION_ACTIVATE))
    assert nodes.done == ["fem activate"]


def test_renewal_leaves_nodes_that_do_not_work_alone() -> None:
    nodes = Nodes(INACTIVE)
    nodes.states["fem"] = ACTIVE
    asyncio.run(driver(nodes).renew(NODES))
    assert nodes.done == ["fem deactivate", "fem activate"]
