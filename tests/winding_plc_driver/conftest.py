"""A machine behind a real OPC UA server, a path to it that can be cut, drivers, and a listener."""

import asyncio
import contextlib
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Coroutine, Iterator, Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
import yaml
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from cryptography.x509.oid import ExtendedKeyUsageOID
from rclpy.node import Node
from std_srvs.srv import Trigger

from processes import free_port, in_namespace
from winding_core.status import Level, Status
from winding_ros import topics
from winding_ros.messages.diagnostics import decode_diagnostics

EXAMPLES = Path(__file__).parents[2] / "examples"
# No machine stops by itself because a busy computer keeps the driver waiting.
PATIENT = {"timedelta(seconds=5)": "timedelta(seconds=600)"}
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class Machine:
    """The example machine as a process, its source changed as the test asks."""

    def __init__(self, folder: Path, changes: Mapping[str, str], *options: object) -> None:
        source = (EXAMPLES / "opcua_machine.py").read_text(encoding="utf-8")
        for old, new in {**PATIENT, **changes}.items():
            assert old in source
            source = source.replace(old, new)
        script = folder / "machine.py"
        script.write_text(source, encoding="utf-8")
        self.port = free_port()
        self._record = folder / "record.txt"
        arguments = ["--port", self.port, "--record", self._record, *options]
        self._calls = folder / "calls.txt"
        with self._calls.open("w", encoding="utf-8") as calls:
            self.process = subprocess.Popen(
                [sys.executable, script, *map(str, arguments)], stdout=calls, text=True
            )

    @property
    def calls(self) -> list[str]:
        """Every call of the machine, its own 'ready' first."""
        return self._calls.read_text(encoding="utf-8").split()

    def written(self) -> dict[int, tuple[float, float, float]]:
        """Return (angle [deg], carriage [mm], tension [N]) by source timestamp [ns]."""
        values = {}
        for line in self._record.read_text(encoding="utf-8").splitlines():
            stamp, *numbers = line.split()
            ns = (datetime.fromisoformat(stamp) - EPOCH) // timedelta(microseconds=1) * 1000
            angle, carriage, tension = map(float, numbers)
            values[ns] = (angle, carriage, tension)
        return values


class Relay:
    """A TCP path to a port that can be cut and restored."""

    def __init__(self, target: int) -> None:
        self.target = target
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever)
        self._thread.start()
        self._server: asyncio.Server | None = None
        self._writers: list[asyncio.StreamWriter] = []
        self._silent: set[asyncio.StreamWriter] = set()
        self.port = 0
        self.restore()

    def restore(self) -> None:
        self._do(self._listen())

    def cut(self) -> None:
        self._do(self._close())

    def silence(self) -> None:
        """Leave the connections open and pass on nothing more."""
        self._silent.update(self._writers)

    def end(self) -> None:
        self.cut()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def _do(self, work: Coroutine[Any, Any, None]) -> None:
        asyncio.run_coroutine_threadsafe(work, self._loop).result(timeout=60.0)

    async def _listen(self) -> None:
        self._server = await asyncio.start_server(self._pass_on, "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]

    async def _close(self) -> None:
        if self._server is not None:
            self._server.close()
        for writer in self._writers:
            writer.transport.abort()
        self._writers.clear()

    async def _pass_on(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there, back = await asyncio.open_connection("127.0.0.1", self.target)
        self._writers += [writer, back]
        await asyncio.gather(self._pump(reader, back), self._pump(there, writer))

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError):
            while data := await reader.read(65536):
                if writer not in self._silent:
                    writer.write(data)
                    await writer.drain()
        writer.close()


class Listener:
    """Everything that the driver publishes, and its services."""

    def __init__(self, ros: Any) -> None:
        self.joints: list[Any] = []
        self.forces: list[Any] = []
        self.statuses: list[Status] = []
        self._ros, self._node = ros, ros.add(Node, "probe", namespace="winding")
        topics.JOINT_STATES.subscribe(self._node, self.joints.append)
        topics.TENSION.subscribe(self._node, self.forces.append)
        topics.DIAGNOSTICS.subscribe(self._node, self._reported)

    def call(self, name: str) -> tuple[bool, str]:
        answer = self._ros.call(self._node, Trigger, f"rig/{name}", Trigger.Request())
        return answer.success, answer.message

    def wait(self, reached: Callable[[], Any]) -> None:
        self._ros.spin_until(reached)

    def wait_for(self, level: Level, text: str) -> Status:
        """Return the next status of a level whose message has a text."""
        self.statuses.clear()
        self.wait(lambda: any(s.level is level and text in s.message for s in self.statuses))
        return self.statuses[-1]

    def more(self, count: int) -> None:
        """Wait for so many further joint states."""
        target = len(self.joints) + count
        self.wait(lambda: len(self.joints) >= target)

    def _reported(self, message: Any) -> None:
        self.statuses += decode_diagnostics(message)[1]


@pytest.fixture
def examples() -> Path:
    return EXAMPLES


@pytest.fixture
def machine(tmp_path: Path, ros: Any) -> Iterator[Callable[..., Machine]]:
    """Start machines; they are ready when the call returns."""
    machines = []

    def start(*options: object, changes: Mapping[str, str] | None = None) -> Machine:
        machines.append(Machine(tmp_path, changes or {}, *options))
        ros.spin_until(lambda: "ready" in machines[-1].calls)
        return machines[-1]

    yield start
    for item in machines:
        item.process.kill()
        item.process.wait()


@pytest.fixture
def relay() -> Iterator[Callable[[int], Relay]]:
    """Make paths to a port."""
    relays = []

    def make(target: int) -> Relay:
        relays.append(Relay(target))
        return relays[-1]

    yield make
    for item in relays:
        item.end()


@pytest.fixture
def listener(ros: Any) -> Listener:
    """Hear a driver in namespace /winding."""
    return Listener(ros)


@pytest.fixture
def pair(tmp_path: Path) -> Callable[[str, str], Coroutine[Any, Any, None]]:
    """Make a self-signed certificate NAME.der with its key NAME.pem for an application URI."""

    async def make(name: str, uri: str) -> None:
        await setup_self_signed_certificate(
            tmp_path / f"{name}.pem",
            tmp_path / f"{name}.der",
            uri,
            socket.gethostname(),
            [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH],
            {},
        )

    return make


Secured = tuple[dict[str, str], list[object]]


@pytest.fixture
def secured(
    tmp_path: Path, pair: Callable[[str, str], Coroutine[Any, Any, None]]
) -> Callable[[], Coroutine[Any, Any, Secured]]:
    """Make a pair for each side; return the driver's keys and the machine's options."""

    async def make() -> Secured:
        await pair("driver", "urn:winding:driver")
        await pair("plc", "urn:freeopcua:python:server")
        mapping = {
            "security_policy": "Basic256Sha256",
            "security_mode": "SignAndEncrypt",
            "certificate": "driver.der",
            "private_key": "driver.pem",
            "server_certificate": "plc.der",
        }
        return mapping, ["--certificate", tmp_path / "plc.der", "--key", tmp_path / "plc.pem"]

    return make


@pytest.fixture
def driver(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start drivers of a machine at a port, the mapping changed as the test asks."""
    drivers = []

    def start(
        port: int,
        environment: Mapping[str, str] | None = None,
        sections: Mapping[str, Any] | None = None,
        **server: object,
    ) -> Any:
        mapping = yaml.safe_load((EXAMPLES / "opcua_machine.yaml").read_text(encoding="utf-8"))
        # Patient enough for a busy computer.
        waits = {"call_timeout_s": 30.0, "link_timeout_s": 30.0}
        mapping["server"] |= {"endpoint": f"opc.tcp://127.0.0.1:{port}", **waits, **server}
        mapping["heartbeat"]["timeout_s"] = 60.0
        mapping |= sections or {}
        file = tmp_path / "machine.yaml"
        file.write_text(yaml.safe_dump(mapping), encoding="utf-8")
        command = [sys.executable, "-m", "winding_plc_driver", "--mapping", str(file)]
        process = subprocess.Popen(
            [*command, *in_namespace("winding")],
            env=os.environ | (environment or {}),
            stderr=subprocess.PIPE,
            text=True,
        )
        drivers.append(process)
        return process

    yield start
    for process in drivers:
        process.kill()
        assert "Traceback" not in (process.communicate()[1] or "")


@pytest.fixture
def linked(machine: Any, relay: Any, driver: Any, listener: Listener) -> Callable[..., Any]:
    """Start a machine and its driver, and wait for the first joint state."""

    def start(
        *options: object,
        changes: Mapping[str, str] | None = None,
        environment: Mapping[str, str] | None = None,
        **server: object,
    ) -> tuple[Machine, Relay]:
        plc = machine(*options, changes=changes)
        path = relay(plc.port)
        driver(path.port, environment, **server)
        listener.more(1)
        return plc, path

    return start
