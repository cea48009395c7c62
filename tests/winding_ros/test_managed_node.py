"""Managed nodes: parameters, transitions, their order in a graph, subscription validation."""

import asyncio
from dataclasses import dataclass
from typing import Any

import pytest
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import DescribeParameters, SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter

from winding_core.parameters import ParameterError, parameter
from winding_core.status import Level, Status
from winding_ros import topics
from winding_ros.client.lifecycle import ACTIVATE, CLEANUP, CONFIGURE, DEACTIVATE, LifecycleDriver
from winding_ros.graph import GraphError, NodeSpec
from winding_ros.message_guard import (
    GHOST_PATIENCE,
    MAX_JUMP,
    UNKNOWN_NODE,
    Cadence,
    MessageGuard,
    Rivals,
    StampError,
    topic_status,
)
from winding_ros.messages.diagnostics import decode_diagnostics
from winding_ros.messages.rig import decode_tension, encode_tension
from winding_ros.runtime.managed_node import ManagedNode

NODES = ("correction", "fem", "rig")
NAMES = {CONFIGURE: "configure", ACTIVATE: "activate", DEACTIVATE: "deactivate", CLEANUP: "cleanup"}
UNCONFIGURED = State.PRIMARY_STATE_UNCONFIGURED
INACTIVE = State.PRIMARY_STATE_INACTIVE
ACTIVE = State.PRIMARY_STATE_ACTIVE
LEADS_TO = {
    (CONFIGURE, UNCONFIGURED): INACTIVE,
    (ACTIVATE, INACTIVE): ACTIVE,
    (DEACTIVATE, ACTIVE): INACTIVE,
    (CLEANUP, INACTIVE): UNCONFIGURED,
}
EPOCH = 1.8e9


@dataclass(frozen=True, kw_only=True)
class Wanted:
    gain: float = parameter(1.0, "gain of the test", low=0.0, high=2.0, read_only=False)
    flavour: str = parameter("plain", "flavour of the test", choices=("plain", "salted"))


class Listener(ManagedNode[Wanted]):
    def __init__(self, **kwargs: object) -> None:
        super().__init__(NodeSpec(name="listener"), Wanted, **kwargs)
        self.forces: list[float] = []

    def configure(self) -> None:
        if self.configuration.flavour == "salted":
            raise ValueError("salt must be dry")
        self.endpoints.advertise(topics.FEM_MARKERS)
        self.endpoints.subscribe(topics.TENSION, lambda m: self.forces.append(decode_tension(m)[1]))


def change(ros: object, probe: object, transition: int) -> bool:
    request = ChangeState.Request(transition=Transition(id=transition))
    return ros.call(probe, ChangeState, "/listener/change_state", request).success


def state(ros: object, probe: object) -> int:
    return ros.call(probe, GetState, "/listener/get_state", GetState.Request()).current_state.id


def heard(probe: object) -> dict[str, Status]:
    """Return the statuses that a node hears from now on, by name."""
    statuses: dict[str, Status] = {}
    topics.DIAGNOSTICS.subscribe(
        probe, lambda m: statuses.update({s.name: s for s in decode_diagnostics(m)[1]})
    )
    return statuses


def test_full_life(ros: object) -> None:
    ros.add(Listener)
    probe = ros.plain()
    for transition, reached in (
        (Transition.TRANSITION_CONFIGURE, State.PRIMARY_STATE_INACTIVE),
        (Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE),
        (Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE),
        (Transition.TRANSITION_CLEANUP, State.PRIMARY_STATE_UNCONFIGURED),
        (Transition.TRANSITION_CONFIGURE, State.PRIMARY_STATE_INACTIVE),
    ):
        assert change(ros, probe, transition)
        assert state(ros, probe) == reached


def test_invalid_transition_is_refused_and_the_node_lives(ros: object) -> None:
    ros.add(Listener)
    probe = ros.plain()
    assert not change(ros, probe, Transition.TRANSITION_ACTIVATE)
    assert not change(ros, probe, 99)
    assert state(ros, probe) == State.PRIMARY_STATE_UNCONFIGURED


def test_refused_configuration_leaves_the_node_unconfigured_with_the_reason(ros: object) -> None:
    node = ros.add(Listener, parameters={"flavour": "salted"})
    probe = ros.plain()
    statuses = heard(probe)
    assert not change(ros, probe, Transition.TRANSITION_CONFIGURE)
    assert state(ros, probe) == State.PRIMARY_STATE_UNCONFIGURED
    ros.spin_until(lambda: any(s.level is Level.ERROR for s in statuses.values()))
    assert "cannot configure: salt must be dry" in {s.message for s in statuses.values()}
    assert node.forces == []


def test_matched_subscribers_are_reported(ros: object) -> None:
    ros.add(Listener)
    probe = ros.plain()
    statuses = heard(probe)
    topics.FEM_MARKERS.subscribe(probe, lambda message: None)
    assert change(ros, probe, Transition.TRANSITION_CONFIGURE)
    ros.spin_until(
        lambda: any(s.values.get("matched fem/markers") == "1" for s in statuses.values())
    )


def test_refused_message_is_counted_and_does_not_stop_the_node(ros: object) -> None:
    node = ros.add(Listener)
    probe = ros.plain()
    statuses = heard(probe)
    change(ros, probe, Transition.TRANSITION_CONFIGURE)
    publisher = topics.TENSION.advertise(probe)
    ros.spin_until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(encode_tension(0.0, float("nan")))
    publisher.publish(encode_tension(0.1, 2.0))
    ros.spin_until(lambda: node.forces == [2.0])
    ros.spin_until(
        lambda: any(s.values.get("refused rig/tension") == "1" for s in statuses.values())
    )


def test_unknown_parameter_is_refused_before_the_node_exists(ros: object) -> None:
    with pytest.raises(ParameterError, match="has no parameter gane; did you mean gain"):
        ros.add(Listener, parameters={"gane": 1.0})


def test_whole_number_override_of_a_float_is_taken(ros: object) -> None:
    assert ros.add(Listener, parameters={"gain": 2}).configuration.gain == 2.0


def test_parameters_describe_themselves_and_keep_their_range(ros: object) -> None:
    ros.add(Listener)
    probe = ros.plain()
    described = ros.call(
        probe,
        DescribeParameters,
        "/listener/describe_parameters",
        DescribeParameters.Request(names=["gain"]),
    ).descriptors[0]
    assert described.description == "gain of the test"
    assert described.floating_point_range[0].to_value == 2.0
    request = SetParameters.Request(parameters=[Parameter("gain", value=3.0).to_parameter_msg()])
    result = ros.call(probe, SetParameters, "/listener/set_parameters", request).results[0]
    assert not result.successful


def test_read_only_parameter_may_be_chosen_until_the_node_is_configured(ros: object) -> None:
    node = ros.add(Listener)
    probe = ros.plain()

    def choose(flavour: str) -> object:
        chosen = Parameter("flavour", value=flavour).to_parameter_msg()
        request = SetParameters.Request(parameters=[chosen])
        return ros.call(probe, SetParameters, "/listener/set_parameters", request).results[0]

    assert choose("salted").successful
    assert not change(ros, probe, Transition.TRANSITION_CONFIGURE)
    assert choose("plain").successful
    assert change(ros, probe, Transition.TRANSITION_CONFIGURE)
    assert node.configuration.flavour == "plain"
    refused = choose("salted")
    assert not refused.successful
    assert refused.reason.startswith("parameter flavour is fixed while the node is configured")
    assert change(ros, probe, Transition.TRANSITION_CLEANUP)
    assert choose("salted").successful


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


def test_state_shows_the_result_of_a_transition_without_an_answer() -> None:
    nodes = Nodes(INACTIVE, loses="fem activate")
    asyncio.run(driver(nodes).change("fem", Transition.TRANSITION_ACTIVATE))
    assert nodes.done == ["fem activate"]


def test_renewal_leaves_nodes_that_do_not_work_alone() -> None:
    nodes = Nodes(INACTIVE)
    nodes.states["fem"] = ACTIVE
    asyncio.run(driver(nodes).renew(NODES))
    assert nodes.done == ["fem deactivate", "fem activate"]


def test_time_may_stand_and_go_forward_but_not_back() -> None:
    intake = MessageGuard("rig/tension")
    for stamp in (1.0, 1.0, 1.5):
        intake.check(stamp, lambda: 0.0)
    with pytest.raises(StampError, match=r"time went back from 1\.500 to 1\.499 s"):
        intake.check(1.499, lambda: 0.0)
    intake.check(1.6, lambda: 0.0)
    # A new run takes the next stamp as it comes.
    intake.restart()
    intake.check(0.0, lambda: 0.0)


def test_jump_is_refused_unless_the_node_s_clock_has_jumped_too() -> None:
    intake = MessageGuard("rig/tension")
    intake.check(1.0, lambda: 1.0)
    later = 1.0 + 2.0 * MAX_JUMP
    with pytest.raises(StampError, match="time jumped"):
        intake.check(later, lambda: 1.0)
    intake.check(later, lambda: later)


@pytest.mark.parametrize(
    ("stamps", "arrivals"),
    [
        ((10.0, 10.04, 10.06), (5.0, 5.04, 5.06)),
        # A reader that was held looks at all of it within a millisecond.
        ((10.0, 10.04, 10.06), (5.0, 5.0, 5.001)),
        # Stamps that are themselves the reason: nothing but arrivals is left.
        ((None, None, None), (5.0, 5.04, 5.06)),
    ],
)
def test_refusals_over_fifty_milliseconds_of_stamps_latch_an_alarm(stamps, arrivals) -> None:
    guard = MessageGuard("rig/tension")
    for stamp, arrival in zip(stamps[:2], arrivals[:2], strict=True):
        guard.refuse("bad", stamp, arrival)
    assert not guard.alarm
    guard.refuse("worse", stamps[2], arrivals[2])
    guard.accept()
    assert guard.alarm == "refused a message on rig/tension: worse"
    assert (guard.refused, guard.accepted) == (3, 1)
    status = topic_status("marker_tracker", {}, {guard.topic: guard}, [])
    assert (status.level, status.message) == (Level.ERROR, guard.alarm)
    guard.restart()
    assert (guard.alarm, guard.refused, guard.accepted) == ("", 0, 0)


def test_a_late_reader_alone_latches_no_alarm() -> None:
    guard = MessageGuard("rig/tension")
    guard.refuse("bad", 10.0, 5.0)
    guard.refuse("bad", 10.008, 5.2)
    assert not guard.alarm


def test_contested_topic_lets_nothing_in() -> None:
    intake = MessageGuard("rig/tension")
    intake.contested = "rig/tension has 2 publishers: /a, /b"
    with pytest.raises(StampError, match="has 2 publishers"):
        intake.check(1.0, lambda: 1.0)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("rogue", "rig/tension has 2 publishers: /winding/rig, /winding/rogue"),
        # A publisher whose name is not known yet.
        (UNKNOWN_NODE, ""),
    ],
)
def test_second_name_is_a_rival_at_once(name: str, sentence: str) -> None:
    publishers = [("/winding", "rig"), ("/winding", name)]
    assert Rivals().look("rig/tension", publishers[:1], 0.0).sentence == ""
    assert Rivals().look("rig/tension", publishers, 0.0).sentence == sentence


def test_successor_of_a_killed_process_is_no_rival_for_a_while() -> None:
    twice = [("/winding", "marker_tracker")] * 2
    rivals = Rivals().look("tracker/markers", twice, 100.0)
    assert rivals.sentence == ""
    assert rivals.look("tracker/markers", twice, 100.0 + GHOST_PATIENCE).sentence == ""
    assert rivals.look("tracker/markers", twice, 100.1 + GHOST_PATIENCE).sentence != ""
    assert rivals.look("tracker/markers", twice[:1], 105.0) == Rivals()


def test_longest_queue_is_kept_until_it_is_reported() -> None:
    intake = MessageGuard("rig/tension")
    for count in (1, 7, 2):
        intake.found(count)
    assert intake.queue == 7
    intake.restart_queue()
    assert intake.queue == 0


def test_rate_is_measured_and_losses_are_counted_against_it() -> None:
    cadence = Cadence("rig/joint_states")
    for sample in range(400):
        if sample % 20 != 19 or sample < 64:
            cadence.take(EPOCH + 0.025 * sample, 0.025 * sample)
    assert cadence.period == pytest.approx(0.025, abs=1e-6)
    # Every twentieth of 64 to 398: 79, 99, ... 379; that of 399 is not missed yet.
    assert cadence.counts["lost"] == 16
    assert cadence.values()["rate rig/joint_states"] == "40.0"
    assert cadence.warning == "rig/joint_states has lost 4% of its messages at 40 Hz"


def test_an_interruption_is_no_loss_and_lateness_is_seen() -> None:
    cadence = Cadence("camera/image_raw")
    for sample in range(100):
        stamp = 0.02 * sample + (30.0 if sample >= 50 else 0.0)
        cadence.take(stamp, stamp + (0.1 if sample >= 70 else 0.0))
    assert cadence.counts == {"lost": 0, "doubled": 0, "reordered": 0, "late": 1, "interrupted": 1}


def test_guard_refuses_what_is_reordered_and_counts_both_kinds() -> None:
    guard = MessageGuard("rig/tension", steady=True)
    for sample in range(20):
        guard.check(0.01 * sample, lambda: 0.0)
    guard.check(0.19, lambda: 0.0)
    with pytest.raises(StampError, match="time went back"):
        guard.check(0.15, lambda: 0.0)
    values = topic_status("fem", {}, {"rig/tension": guard}, ()).values
    assert values["doubled rig/tension"] == "1"
    assert values["reordered rig/tension"] == "1"
    guard.restart()
    assert "doubled rig/tension" not in topic_status("fem", {}, {"x": guard}, ()).values
