"""Keeps the link, passes values and commands on and reports the state; imports no ROS."""

import asyncio
import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from winding_core.machine.joining import Joiner, Sample
from winding_core.status import Level, Status
from winding_plc_driver.machine.link import HeartbeatWatch, Link
from winding_plc_driver.machine.mapping import AXES, START, MachineMapping, State
from winding_plc_driver.machine.pacing import Measured, Pacer
from winding_plc_driver.machine.reading import ServerValue, VariableReader
from winding_plc_driver.opcua.nodes import READ, STATE
from winding_plc_driver.opcua.request import LinkError, RefusedError
from winding_plc_driver.opcua.session import Session

# What waits for its time is looked at so often [s].
_LOOK = 0.02
_REPORT = 1.0


class Outlets(Protocol):
    """Where the driver's results go."""

    def joints(self, sample: Sample) -> None:
        """Publish the axes."""

    def measured(self, stamp_ns: int, measured: Measured) -> None:
        """Publish the value of a quantity with its source timestamp [ns]."""

    def status(self, status: Status) -> None:
        """Publish the driver's state."""

    def log(self, text: str) -> None:
        """Report an event to the operator."""


@dataclass(eq=False)
class Driver:
    """Drives one machine; every method runs on one event loop."""

    mapping: MachineMapping  # Of the machine
    session: Session  # With its server
    clock: Callable[[], float]  # Monotonic time [s]
    wall: Callable[[], float]  # Wall time [s since 1970]

    def __post_init__(self) -> None:
        self._link = Link(self.mapping.server, self.clock())
        self._heartbeat = HeartbeatWatch(self.mapping.heartbeat)
        self._readers = {
            name: VariableReader(name, v) for name, v in self.mapping.variables.items()
        }
        self._joiner = Joiner(self.mapping.axes, self.mapping.server.join_wait_s)
        self._pacer = Pacer(self.clock())
        self._state: object = None
        self._beat_complaint = ""
        self._opened = False
        self._changed = asyncio.Event()

    async def contact(self) -> None:
        """Try to reach the PLC once; `run` goes on trying.

        Raises:
            RefusedError: It refuses user, certificate or mapping.
        """
        try:
            await self.session.open()
            self._opened = True
        except LinkError as error:
            self.session.abandon()
            self._link.failed(str(error))
        except RefusedError:
            self.session.abandon()
            raise

    async def run(self, outlets: Outlets) -> None:
        """Drive until cancelled."""
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._release(outlets))
                tasks.create_task(self._report(outlets))
                tasks.create_task(self._keep_link(outlets))
        finally:
            await self.session.close()

    async def command(self, name: str) -> tuple[bool, str]:
        """Return (whether the command was executed, one sentence)."""
        refusal = self._link.refuse(name, self.clock())
        if not refusal and name == START:
            refusal = self._heartbeat.complaint(self.clock())
        if refusal:
            return False, refusal
        try:
            return await self.session.call(name, self.mapping.commands[name])
        except LinkError as error:
            return False, str(error)

    async def _keep_link(self, outlets: Outlets) -> None:
        while True:
            try:
                if not self._opened:
                    await self.session.open()
                self._opened = False
                while stop := self._link.stop_on_return(self.clock()):
                    _, answer = await self.session.call(stop, self.mapping.commands[stop])
                    self._link.stopped(stop)
                    outlets.log(f"the link is back and the machine received {stop}: {answer}")
                self._link.established()
                self._changed.set()
                outlets.log(f"ready: the link to {self.mapping.server.endpoint} is up")
                await self._follow(outlets)
            except (LinkError, RefusedError) as error:
                self.session.abandon()
                wait = 0.0
                if self._link.up:
                    self._link.lost(self.clock(), str(error))
                    outlets.log(self._link.complaint(self.clock()))
                else:
                    wait = self._link.failed(str(error))
                self._changed.set()
                await asyncio.sleep(wait)

    async def _follow(self, outlets: Outlets) -> None:
        """Take what the PLC sends until the link is lost."""
        self._heartbeat.restart(self.clock())
        beat = asyncio.create_task(self._beat())
        try:
            async with contextlib.aclosing(
                self.session.subscription.notifications()
            ) as notifications:
                async for values in notifications:
                    for value in values:
                        self._take(value)
                    self._publish(outlets)
                    await self.session.renew()
        finally:
            beat.cancel()

    def _take(self, value: ServerValue) -> None:
        if value.title == READ:
            self._heartbeat.see(value.value, self.clock())
        elif value.title == STATE:
            if value.value != self._state:
                self._changed.set()
            self._state = value.value
        elif (read := self._readers[value.title].read(value)) is not None:
            stamp_ns, number = read
            if value.title in AXES:
                self._joiner.add(value.title, stamp_ns, number, self.clock())
            else:
                self._pacer.add(stamp_ns, Measured(value.title, number))

    def _publish(self, outlets: Outlets) -> None:
        now = self.clock()
        for sample in self._joiner.take(now):
            self._pacer.add(sample.stamp_ns, sample)
        for stamp_ns, item in self._pacer.take(now):
            if isinstance(item, Sample):
                outlets.joints(item)
            else:
                outlets.measured(stamp_ns, item)

    async def _release(self, outlets: Outlets) -> None:
        while True:
            await asyncio.sleep(_LOOK)
            self._publish(outlets)

    async def _beat(self) -> None:
        heartbeat = self.mapping.heartbeat
        while heartbeat.write:
            try:
                await self.session.beat(self._heartbeat.advance())
                self._beat_complaint = ""
            except (LinkError, RefusedError) as error:
                self._beat_complaint = str(error)
            await asyncio.sleep(heartbeat.period_s)

    async def _report(self, outlets: Outlets) -> None:
        while True:
            self._changed.clear()
            outlets.status(self._status())
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_REPORT):
                    await self._changed.wait()

    def _status(self) -> Status:
        now = self.clock()
        errors = [self._link.complaint(now)]
        if self._link.up:
            errors.append(self._heartbeat.complaint(now))
        further = {
            "endpoint": self.mapping.server.endpoint,
            "links lost": str(self._link.losses),
            "sessions resumed": str(self.session.resumed),
            "channels renewed": str(self.session.renewed),
        }
        if self.mapping.state is not None:
            words, fault = machine_state(self.mapping.state, self._state)
            further["machine"] = words
            if fault and self._link.up:
                errors.append(f"the machine reports {words}")
        if self.mapping.heartbeat.read:
            further["heartbeat of the PLC"] = str(self._heartbeat.seen)
        newest = max(reader.newest_ns for reader in self._readers.values())
        if newest:
            # The PLC's clock and the way from it: far from zero, one of the clocks is not set.
            further["age of the newest value"] = f"{self.wall() - 1e-9 * newest:.3f} s"
        return self._counted([error for error in errors if error], further)

    def _counted(self, errors: list[str], values: dict[str, str]) -> Status:
        """Return the status with what was counted.

        Args:
            errors: Sentences on what does not work, worst first; the numbers' own are added.
            values: What else is to be shown, before the counts.
        """
        readers, counts = self._readers, self._joiner.counts
        numbers = self.session.subscription.numbers
        overflows = sum(reader.overflows for reader in readers.values())
        errors += [reader.complaint for reader in readers.values() if reader.complaint]
        warnings = [self._beat_complaint] if self._beat_complaint else []
        if numbers.gaps or overflows or counts.late:
            warnings.append(
                f"lost so far: {numbers.gaps} notifications, {overflows} times values from a full "
                f"queue, {counts.late} values that came too late"
            )
        for name, reader in readers.items():
            values[f"{name} taken"] = str(reader.taken)
            values[f"{name} repeated"] = str(reader.repeated)
            values[f"{name} unusable"] = str(reader.unusable)
        values |= {
            "samples joined": str(counts.joined),
            "samples interpolated": str(counts.interpolated),
            "samples held": str(counts.held),
            "values too late": str(counts.late),
            "values too early": str(counts.early),
            "queue overflows": str(overflows),
            "notifications missing": str(numbers.gaps),
            "notifications fetched again": str(numbers.fetched),
            "notifications repeated": str(numbers.repeated),
        }
        level = Level.ERROR if errors else Level.WARN if warnings else Level.OK
        sentences = errors or warnings or ["the link is up"]
        return Status(name=NAME, level=level, message="; ".join(sentences), values=values)


NAME = "winding_rig: PLC"


def machine_state(state: State, value: object) -> tuple[str, bool]:
    """Return (the machine's state in words, whether it is a fault)."""
    words = state.names.get(value) if isinstance(value, int) else None
    return words or str(value), value in state.faults
