"""A winding machine behind an OPC UA server, as a PLC would have it, to try the driver on."""

import argparse
import asyncio
import logging
import signal
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from asyncua import Server, ua
from asyncua.crypto.permission_rules import User, UserRole

PERIOD, OMEGA, FEED, TENSION = 0.01, 99.7, 5.0, 1.96  # s, deg/s, mm/s, N
RAMP, QUICK_RAMP, DRIVER_TIMEOUT = 1.0, 0.3, timedelta(seconds=5)
STANDING, WINDING, LATCHED = 0, 1, 2


class Machine:
    def __init__(self, record: Path | None) -> None:
        self.goal = self.share = self.angle = self.carriage = 0.0
        self.latched, self.ramp = False, RAMP
        self.record = record.open("w", encoding="utf-8") if record else None

    def advance(self, due: datetime) -> dict[str, float]:
        step = PERIOD / self.ramp
        self.share += min(step, max(-step, self.goal - self.share))
        self.angle += self.share * OMEGA * PERIOD
        self.carriage += self.share * FEED * PERIOD
        if self.record:
            print(due.isoformat(), self.angle, self.carriage, TENSION, file=self.record, flush=True)
        speeds = {"AngularSpeed": self.share * OMEGA, "FeedSpeed": self.share * FEED}
        return {"Angle": self.angle, "Carriage": self.carriage, "Tension": TENSION, **speeds}

    def call(self, name: str) -> ua.StatusCode:
        print(name, flush=True)
        if name == "Start" and self.latched:
            return ua.StatusCode(ua.StatusCodes.BadInvalidState)
        self.goal = float(name == "Start")
        self.ramp = QUICK_RAMP if name == "QuickStop" else RAMP
        self.latched = name == "EmergencyStop"
        self.share *= not self.latched
        return ua.StatusCode()


class Users:
    def __init__(self, user: str, password: str) -> None:
        self.wanted = (user or None, password or None)

    def get_user(self, _: Any, username: Any = None, password: Any = None, **__: Any) -> Any:
        return User(role=UserRole.User) if (username, password) == self.wanted else None


async def serve(options: argparse.Namespace) -> None:
    server = Server(user_manager=Users(options.user, options.password))
    await server.init()
    server.set_endpoint(f"opc.tcp://127.0.0.1:{options.port}")
    if options.certificate:
        await server.load_certificate(options.certificate)
        await server.load_private_key(options.key)
        server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
    else:
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    space = await server.register_namespace("urn:winding-machine")
    plc = await server.nodes.objects.add_object(ua.NodeId("Machine", space), "Machine")
    machine = Machine(options.record)
    nodes = {}
    for name, first in (
        *(("Angle", 0.0), ("Carriage", 0.0), ("Tension", 0.0)),
        *(("AngularSpeed", 0.0), ("FeedSpeed", 0.0)),
        *(("State", 0), ("Alive", 0), ("DriverAlive", 0)),
    ):
        nodes[name] = await plc.add_variable(ua.NodeId(f"Machine.{name}", space), name, first)
    await nodes["DriverAlive"].set_writable()
    for name in ("Start", "Stop", "QuickStop", "Reset", "EmergencyStop"):

        async def called(_: Any, name: str = name) -> ua.StatusCode:
            return machine.call(name)

        await plc.add_method(ua.NodeId(f"Machine.{name}", space), name, called)

    async def write(name: str, value: float, due: datetime) -> None:
        data = ua.DataValue(ua.Variant(value), SourceTimestamp=due)
        await server.write_attribute_value(nodes[name].nodeid, data)

    async with server:
        print("ready", flush=True)
        due, cycle, heard, heard_at = datetime.now(UTC), 0, 0, datetime.now(UTC)
        while True:
            while due <= datetime.now(UTC):  # what a busy computer missed is made up for
                for name, value in machine.advance(due).items():
                    await write(name, value, due)
                if cycle % 10 == 0:
                    state = LATCHED if machine.latched else WINDING if machine.share else STANDING
                    await write("State", state, due)
                    await write("Alive", cycle // 10, due)
                    alive = await nodes["DriverAlive"].read_value()
                    if alive != heard:
                        heard, heard_at = alive, due
                    elif heard and machine.goal and due - heard_at > DRIVER_TIMEOUT:
                        machine.call("Stop")  # the driver is silent: the PLC stops by itself
                cycle += 1
                due += timedelta(seconds=PERIOD)
                await asyncio.sleep(0.0)  # however busy the computer: the server answers
            await asyncio.sleep(PERIOD / 2.0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=4840)
    parser.add_argument("--user", default="")
    parser.add_argument("--password", default="")
    parser.add_argument("--certificate", type=Path)
    parser.add_argument("--key", type=Path)
    parser.add_argument("--record", type=Path, help="file for every value that is written")
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)
    # Whatever ends a PLC's process ends this one in order.
    signal.signal(signal.SIGTERM, lambda *_: signal.raise_signal(signal.SIGINT))
    try:
        asyncio.run(serve(parser.parse_args()))
    except KeyboardInterrupt:
        sys.exit(0)
