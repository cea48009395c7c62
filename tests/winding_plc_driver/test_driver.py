"""The driver as a process between a real OPC UA server and DDS."""

import math
import signal
from pathlib import Path
from typing import Any

import pytest

from winding_core.status import Level

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.slow]


def stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


def check_nothing_is_lost_or_doubled(listener: Any, machine: Any) -> None:
    """Every value that the server wrote from the first to the last that was heard, once."""
    written = machine.written()
    for messages in (listener.joints, listener.forces):
        heard = [stamp_ns(message) for message in messages]
        assert heard == [ns for ns in written if heard[0] <= ns <= heard[-1]]
    for message in listener.joints:
        angle, carriage, _ = written[stamp_ns(message)]
        # The same product of the same two numbers.
        assert list(message.position) == [angle * (math.pi / 180.0), carriage * 1e-3]
    assert all(m.wrench.force.x == written[stamp_ns(m)][2] for m in listener.forces)


def test_every_value_arrives_once_with_its_source_timestamp(
    machine: Any, driver: Any, listener: Any
) -> None:
    plc = machine()
    process = driver(plc.port)
    listener.more(1)
    assert listener.call("start") == (True, "start: done")
    listener.more(300)
    assert listener.call("stop") == (True, "stop: done")
    listener.more(150)
    assert plc.calls == ["ready", "Start", "Stop"]
    check_nothing_is_lost_or_doubled(listener, plc)
    # 3 s of winding at 1.74 rad/s and a ramp of 1 s at each end.
    assert listener.joints[-1].position[0] > 3.0
    assert listener.joints[-1].position == listener.joints[-2].position
    status = listener.wait_for(Level.OK, "the link is up")
    assert status.values["machine"] == "standing"
    assert {"0"} == {status.values[key] for key in ("angle repeated", "queue overflows")}
    process.send_signal(signal.SIGTERM)
    assert process.wait(60) == 0
    assert "Traceback" not in process.stderr.read()


def test_a_refusal_of_the_plc_is_the_answer(machine: Any, driver: Any, listener: Any) -> None:
    driver(machine().port)
    listener.more(1)
    assert listener.call("emergency_stop")[0]
    done, answer = listener.call("start")
    assert not done
    assert answer.startswith("start was refused: ")
    assert "(BadInvalidState)" in answer
    listener.wait_for(Level.ERROR, "the machine reports emergency stop")
    assert listener.call("reset")[0]
    assert listener.call("start")[0]


def test_a_command_may_be_a_variable(machine: Any, driver: Any, listener: Any) -> None:
    space = "nsu=urn:winding-machine;s=Machine."
    variables = {
        "start": "DriverAlive",
        "stop": "State",
        "reset": "DriverAlive",
        "emergency_stop": "DriverAlive",
    }
    commands = {
        command: {"node": f"{space}{variable}", "value": 77}
        for command, variable in variables.items()
    }
    heartbeat = {"read": f"{space}DriverAlive", "timeout_s": 600.0}
    driver(machine().port, sections={"commands": commands, "heartbeat": heartbeat})
    listener.more(1)
    done, answer = listener.call("quick_stop")
    assert not done
    # State is the PLC's alone.
    assert answer.startswith("quick_stop was refused: ")
    assert listener.call("start") == (True, "start: 77 is written")
    assert listener.wait_for(Level.OK, "the link is up").values["heartbeat of the PLC"] == "77"


def test_losses_and_marked_bad_values_are_counted(machine: Any, driver: Any, listener: Any) -> None:
    """Good with the overflow bit, and BadSensorFailure, from the server on its own."""
    status = "0x480 if cycle % 10 == 3 else 0x808C0000 if cycle % 10 == 7 else 0"
    marked = {"SourceTimestamp=due)": f"ua.StatusCode({status}), due)"}
    driver(machine(changes=marked).port)
    listener.more(100)
    listener.statuses.clear()
    listener.wait(lambda: listener.statuses)
    values = listener.statuses[-1].values
    assert int(values["queue overflows"]) > 0
    assert int(values["angle unusable"]) > 0
    listener.wait(lambda: any("lost so far" in s.message for s in listener.statuses))


def test_a_call_that_hangs_is_given_up(machine: Any, driver: Any, listener: Any) -> None:
    slow = {"return machine.call(name)": "await asyncio.sleep(600.0 * (name == 'Reset'))"}
    driver(machine(changes=slow).port, call_timeout_s=0.5)
    listener.more(1)
    assert listener.call("reset") == (False, "reset was not answered within 0.5 s")


def test_a_cut_link_is_reported_and_the_server_s_queue_taken(linked: Any, listener: Any) -> None:
    plc, path = linked(stop_after_link_loss_s=0.0)
    assert listener.call("start")[0]
    listener.more(100)
    path.cut()
    listener.wait_for(Level.ERROR, "has been lost for")
    done, answer = listener.call("start")
    assert not done
    assert f"the link to the PLC at opc.tcp://127.0.0.1:{path.port} has been lost" in answer
    path.restore()
    status = listener.wait_for(Level.OK, "the link is up")
    assert (status.values["links lost"], status.values["sessions resumed"]) == ("1", "1")
    listener.more(300)
    assert plc.calls == ["ready", "Start"]
    check_nothing_is_lost_or_doubled(listener, plc)


def test_a_silent_link_is_lost(linked: Any, listener: Any) -> None:
    plc, path = linked(link_timeout_s=3.0)
    listener.more(100)
    path.silence()
    listener.wait(
        lambda: any("was not answered within 3 s" in s.message for s in listener.statuses)
    )
    listener.wait_for(Level.OK, "the link is up")
    listener.more(100)
    check_nothing_is_lost_or_doubled(listener, plc)


@pytest.mark.parametrize("asked", ["", "quick_stop"])
def test_a_machine_is_stopped_when_the_link_returns(asked: str, linked: Any, listener: Any) -> None:
    plc, path = linked(stop_after_link_loss_s=0.0 if asked else 1e-6)
    assert listener.call("start")[0]
    listener.more(100)
    path.cut()
    listener.wait_for(Level.ERROR, "has been lost for")
    if asked:
        done, answer = listener.call(asked)
        assert not done
        assert answer.endswith("; quick_stop is sent when the link returns")
    path.restore()
    listener.wait_for(Level.OK, "the link is up")
    assert plc.calls == ["ready", "Start", "QuickStop" if asked else "Stop"]
    listener.wait(lambda: listener.joints[-1].position == listener.joints[-2].position)


def test_a_server_that_forgot_gets_a_new_session(machine: Any, linked: Any, listener: Any) -> None:
    _, path = linked()
    listener.more(100)
    path.cut()
    listener.wait_for(Level.ERROR, "has been lost for")
    path.target = machine().port
    path.restore()
    assert listener.wait_for(Level.OK, "the link is up").values["sessions resumed"] == "0"
    listener.more(100)
    stamps = [stamp_ns(message) for message in listener.joints]
    assert stamps == sorted(set(stamps))


def test_a_late_plc_is_waited_for(machine: Any, driver: Any, relay: Any, listener: Any) -> None:
    path = relay(machine().port)
    path.cut()
    driver(path.port)
    listener.wait_for(Level.ERROR, "has been down for")
    assert not listener.call("start")[0]
    path.restore()
    listener.more(10)


def refusal(process: Any) -> str:
    """Return the one sentence with which a driver ends that is refused at the first contact."""
    sentence: str = process.communicate(timeout=60)[1]
    assert process.returncode == 2
    assert sentence.count("\n") == 1
    return sentence


def test_a_variable_that_is_not_there_is_one_sentence(machine: Any, driver: Any) -> None:
    plc = machine(changes={'("Tension", 0.0)': '("Torque", 0.0)', '"Tension": T': '"Torque": T'})
    assert refusal(driver(plc.port)) == (
        "error: tension cannot be read at nsu=urn:winding-machine;s=Machine.Tension: "
        "BadNodeIdUnknown\n"
    )


PASSWORD = ("--user", "winding", "--password", "right")


@pytest.mark.parametrize("encrypted", [False, True])
@pytest.mark.asyncio
async def test_a_wrong_password_is_one_sentence_before_anything_else(
    encrypted: bool, machine: Any, driver: Any, secured: Any, tmp_path: Path
) -> None:
    security, options = await secured() if encrypted else ({}, [])
    plc = machine(*PASSWORD, *options)
    (tmp_path / "password.txt").write_text("wrong\n", encoding="utf-8")
    process = driver(plc.port, user="winding", password_file="password.txt", **security)
    sentence = refusal(process)
    start = f"error: the connection to opc.tcp://127.0.0.1:{plc.port} was refused: "
    assert sentence.startswith(start)
    assert "(BadUserAccessDenied)" in sentence
    assert "wrong" not in sentence


def users_by_certificate(known: Path) -> dict[str, str]:
    """Return the changes of the machine that knows one user, by certificate."""
    users = "Users(options.user, options.password)"
    return {
        "from asyncua.crypto.permission_rules": (
            "from asyncua.server.user_managers import CertificateUserManager\n"
            "from asyncua.crypto.permission_rules"
        ),
        f"    server = Server(user_manager={users})\n": (
            "    users = CertificateUserManager()\n"
            f"    await users.add_user(Path({str(known)!r}), name='winding')\n"
            "    server = Server(user_manager=users)\n"
        ),
    }


BY_CERTIFICATE = {"user_certificate": "user.der", "user_private_key": "user.pem"}


@pytest.mark.parametrize("certified", [False, True], ids=["by name", "by certificate"])
@pytest.mark.asyncio
async def test_a_user_opens_the_session_and_resumes_it(
    certified: bool, linked: Any, listener: Any, secured: Any, pair: Any, tmp_path: Path
) -> None:
    security, options = await secured()
    if certified:
        await pair("user", "urn:winding:user")
        changes = users_by_certificate(tmp_path / "user.der")
        _, path = linked(*options, changes=changes, **security, **BY_CERTIFICATE)
    else:
        user = {"user": "winding", "password_variable": "PLC_PASSWORD"}
        environment = {"PLC_PASSWORD": "right"}
        _, path = linked(*PASSWORD, *options, environment=environment, **security, **user)
    listener.more(100)
    assert listener.call("start") == (True, "start: done")
    path.cut()
    listener.wait_for(Level.ERROR, "has been lost for")
    path.restore()
    status = listener.wait_for(Level.OK, "the link is up")
    assert status.values["sessions resumed"] == "1"
    listener.more(100)


@pytest.mark.parametrize(
    ("certificate", "key", "reason"),
    [
        # The owner of the channel's certificate is no user here.
        ("", "", "BadUserAccessDenied"),
        ("other.der", "other.pem", "BadUserAccessDenied"),
        # asyncua's server's answer to a signature by another key.
        ("user.der", "other.pem", "BadIdentityTokenInvalid"),
        ("user.der", "missing.pem", "missing.pem is not a file"),
    ],
    ids=["anonymous", "unknown user", "another key", "no key"],
)
@pytest.mark.asyncio
async def test_who_is_not_that_user_is_refused_in_one_sentence(
    certificate: str,
    key: str,
    reason: str,
    machine: Any,
    driver: Any,
    secured: Any,
    pair: Any,
    tmp_path: Path,
) -> None:
    security, options = await secured()
    for name in ("user", "other"):
        await pair(name, f"urn:winding:{name}")
    plc = machine(*options, changes=users_by_certificate(tmp_path / "user.der"))
    user = {"user_certificate": certificate, "user_private_key": key}
    sentence = refusal(driver(plc.port, **security, **user))
    start = f"error: the connection to opc.tcp://127.0.0.1:{plc.port} was refused: "
    assert sentence.startswith(start)
    assert reason in sentence
