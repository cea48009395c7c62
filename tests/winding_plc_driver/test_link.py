"""The link's state and the heartbeats, at stated times."""

from winding_plc_driver.machine.link import HeartbeatWatch, Link
from winding_plc_driver.machine.mapping import Heartbeat, Server

SERVER = Server(
    endpoint="opc.tcp://plc:4840",
    reconnect_wait_s=0.5,
    reconnect_wait_max_s=3.0,
    stop_after_link_loss_s=2.0,
)


def lost_link() -> Link:
    """Return a link that was up and has been lost at 10 s."""
    link = Link(SERVER, 0.0)
    link.established()
    link.lost(10.0, "cable out")
    return link


def test_attempts_come_ever_slower_and_fast_again_after_a_success() -> None:
    link = Link(SERVER, 0.0)
    assert [link.failed("no route") for _ in range(4)] == [0.5, 1.0, 2.0, 3.0]
    link.established()
    link.lost(1.0, "cable out")
    assert link.failed("no route") == 0.5


def test_what_is_refused_says_since_when_and_why() -> None:
    link = lost_link()
    assert link.refuse("start", 12.5) == (
        "the link to the PLC at opc.tcp://plc:4840 has been lost for 2.5 s: cable out"
    )
    link.established()
    assert link.refuse("start", 12.5) == ""


def test_a_machine_is_stopped_after_a_long_loss_only() -> None:
    assert lost_link().stop_on_return(11.9) == ""
    assert lost_link().stop_on_return(12.1) == "stop"
    assert Link(SERVER, 0.0).stop_on_return(100.0) == ""


def test_the_strongest_stop_is_owed_and_paid_once() -> None:
    link = lost_link()
    for command in ("emergency_stop", "start", "stop"):
        link.refuse(command, 10.5)
    assert link.stop_on_return(10.6) == "emergency_stop"
    link.stopped("emergency_stop")
    assert link.stop_on_return(20.0) == ""
    link.established()
    link.lost(20.0, "cable out")
    assert link.stop_on_return(20.1) == ""


def test_a_stop_that_is_asked_for_while_a_weaker_one_is_given_is_owed() -> None:
    link = lost_link()
    assert link.stop_on_return(13.0) == "stop"
    link.refuse("quick_stop", 13.1)
    link.stopped("stop")
    assert link.stop_on_return(13.2) == "quick_stop"


def test_a_program_that_stands_is_said() -> None:
    watch = HeartbeatWatch(Heartbeat(read="i=1", timeout_s=1.0))
    watch.restart(0.0)
    assert watch.complaint(0.9) == ""
    assert "stood at None for 1.5 s" in watch.complaint(1.5)
    watch.see(7, 2.0)
    watch.see(7, 2.9)
    assert watch.complaint(2.9) == ""
    assert "stood at 7 for 1.1 s, more than 1 s" in watch.complaint(3.1)
    assert HeartbeatWatch(Heartbeat()).complaint(1e6) == ""


def test_the_drivers_counter_fits_a_small_integer() -> None:
    watch = HeartbeatWatch(Heartbeat())
    counts = [watch.advance() for _ in range(2**15 + 1)]
    assert (counts[0], max(counts), counts[-1]) == (1, 2**15 - 1, 1)
