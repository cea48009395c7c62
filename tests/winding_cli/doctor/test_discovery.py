"""Variables, domain, datagrams and the exchange of messages, each in trouble for real."""

import os
import shutil
import socket
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from processes import ran
from winding_cli.commands.doctor import udp_ports
from winding_cli.doctor import network
from winding_cli.doctor.finding import Finding, Level
from winding_cli.doctor.installation import judge_variables
from winding_cli.doctor.network import Exchange, exchange, judge_exchange
from winding_supervisor.session.domain_lock import domain_lock, lock_folder

EPHEMERAL = (32_768, 60_999)
# No test process is given this one.
FREE_DOMAIN = 101
DOMAIN = int(os.environ["ROS_DOMAIN_ID"])


def variable(name: str, value: str) -> Finding:
    found = judge_variables({name: value}, os.path.isfile)
    return next(finding for finding in found if finding.check == name)


def test_environment_without_variables_is_fine() -> None:
    assert {finding.level for finding in judge_variables({}, os.path.isfile)} == {Level.OK}


def test_variables_are_judged_by_what_they_do() -> None:
    wrong = []
    for name, value, level in (
        ("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp", Level.OK),
        ("RMW_IMPLEMENTATION", "rmw_nowhere", Level.FAIL),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST", Level.OK),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET", Level.WARN),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF", Level.FAIL),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "EVERYWHERE", Level.FAIL),
        ("ROS_LOCALHOST_ONLY", "1", Level.WARN),
        ("ROS_STATIC_PEERS", "10.0.0.1", Level.WARN),
        ("ROS_DISCOVERY_SERVER", "10.0.0.1:11811", Level.WARN),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", "", Level.WARN),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", "/nowhere.xml", Level.WARN),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", __file__, Level.WARN),
    ):
        found = variable(name, value)
        if found.level is not level or bool(found.advice) is (level is Level.OK):
            wrong.append((name, value, found))
    assert wrong == []


def test_domain_s_ports_stay_clear_of_those_that_the_system_hands_out() -> None:
    domains = (0, 101, 102, 213, 232)
    levels = [network.judge_domain(n, "--domain", EPHEMERAL).level for n in domains]
    assert levels == [Level.OK, Level.OK, Level.WARN, Level.WARN, Level.OK]
    assert max(network.participant_ports(232)) < 65_536


@pytest.fixture
def taken_ports() -> Iterator[list[int]]:
    """Ports of 28 of the 32 participants of a domain, bound by another program."""
    ports = network.participant_ports(FREE_DOMAIN)[:28]
    with ExitStack() as stack:
        for port in ports:
            other = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            other.bind(("127.0.0.1", port))
        yield ports


def test_ports_in_use_are_found(taken_ports: list[int]) -> None:
    seen = udp_ports()
    assert set(taken_ports) <= set(seen)
    crowded = network.judge_ports(FREE_DOMAIN, seen)
    assert crowded.level is Level.FAIL
    assert crowded.found == "4 of 32 places for participants are free"
    some = network.judge_ports(FREE_DOMAIN, taken_ports[:2])
    assert some.level is Level.WARN
    assert some.found.endswith(f"in use: UDP {taken_ports[0]}, {taken_ports[1]}")
    assert network.judge_ports(FREE_DOMAIN, []).level is Level.OK


def test_graph_that_owns_the_domain_is_found_for_as_long_as_it_runs() -> None:
    with domain_lock(FREE_DOMAIN, "doctor_test"):
        held = network.holders(lock_folder(), FREE_DOMAIN)
        assert held == ["doctor_test"]
        assert network.judge_owners(FREE_DOMAIN, "doctor_test", held).level is Level.FAIL
        assert network.judge_owners(FREE_DOMAIN, "winding", held).level is Level.WARN
    assert network.holders(lock_folder(), FREE_DOMAIN) == []
    assert network.judge_owners(FREE_DOMAIN, "winding", []).level is Level.OK


def test_datagrams_arrive_on_this_machine() -> None:
    assert {finding.level for finding in network.judge_loopback(60.0)} == {Level.OK}


def test_loopback_that_is_down_is_a_failure() -> None:
    """A network of one's own has a loopback, and it is down."""
    unshare = shutil.which("unshare")
    look = (
        "from winding_cli.doctor.network import judge_loopback\n"
        "for finding in judge_loopback(5.0):\n"
        "    print(finding.level.value, finding.found)"
    )
    if unshare is None or ran(unshare, "-n", "true").returncode:
        pytest.skip("only root may have a network of its own")
    done = ran(unshare, "-n", sys.executable, "-c", look, timeout=120.0, check=True)
    unicast, multicast = done.stdout.splitlines()
    assert unicast.startswith("FAIL ")
    assert multicast.startswith("WARN ")
    # The reason is the kernel's, and not that nothing came.
    assert "nothing arrived" not in done.stdout


@pytest.mark.processes
def test_two_processes_exchange_messages_and_see_a_foreign(ros: Any, tmp_path: Path) -> None:
    foreign = ros.plain("foreign")
    # A busy machine may be slower than the time that other nodes are given to show themselves.
    for _ in range(5):
        result = exchange(os.environ, DOMAIN, tmp_path)
        if result.others:
            break
    found = {finding.check: finding for finding in judge_exchange(result)}
    assert found["middleware"].level is Level.OK
    assert found["message exchange"].level is not Level.FAIL
    assert len(result.round_trips) == 20
    assert all(0.0 < seconds < 60.0 for seconds in result.round_trips)
    seen = network.judge_others(result.others)
    assert seen.level is Level.WARN
    assert seen.advice
    assert f"/{foreign.get_name()}" in seen.found
    assert network.judge_others([]).level is Level.OK


@pytest.mark.processes
def test_middleware_that_is_nowhere_is_a_failure_with_its_reason(tmp_path: Path) -> None:
    result = exchange({**os.environ, "RMW_IMPLEMENTATION": "rmw_nowhere"}, DOMAIN, tmp_path)
    middleware, message = judge_exchange(result)
    assert (middleware.level, message.level) == (Level.FAIL, Level.FAIL)
    assert "rmw_nowhere" in middleware.found


@pytest.mark.processes
def test_discovery_that_is_off_is_a_failure(tmp_path: Path) -> None:
    hidden = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}
    hidden.pop("FASTRTPS_DEFAULT_PROFILES_FILE", None)
    middleware, message = judge_exchange(exchange(hidden, DOMAIN, tmp_path, patience=5.0))
    assert middleware.level is Level.OK
    assert message.level is Level.FAIL
    assert message.found == "two processes do not find each other in 5 s"


def test_slow_answers_and_another_middleware_are_warnings() -> None:
    slow = Exchange(middleware="rmw_cyclonedds_cpp", round_trips=(0.06, 0.07, 0.2))
    middleware, message = judge_exchange(slow)
    assert (middleware.level, message.level) == (Level.WARN, Level.WARN)
    assert "70.00 ms in the middle, 200.00 ms at most" in message.found


def test_locks_of_another_domain_do_not_count(tmp_path: Path) -> None:
    (tmp_path / "domain-10-winding.lock").touch()
    assert network.holders(tmp_path, 1) == []
