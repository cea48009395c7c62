"""What a machine does with commands for its carriage: too early, too late, and when they end."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING

from winding_cli.cell.driver_judgement import Finding, stands
from winding_core.machine.axes import MachineAxes
from winding_core.machine.commands import CARRIAGE, AxisTarget, JointTargets
from winding_core.machine.incoming_readings import MOTION
from winding_core.units import MILLIMETRE
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.messages.commands import encode_targets

if TYPE_CHECKING:
    from winding_cli.cell.driver_probe import Probe

_PERIOD = 0.02
# How long an unanswered motion may go on, by the interface [s].
DEAD_MAN = 0.5
# A stamp that is older than the dead-man time by far [s].
_LATE = 2.0
_LISTEN = 0.6
_FOLLOWED = 1.5
# Of the feed speed, so that the carriage's own programme is told from a command.
_SHARE = 0.5
_TOLERANCE = 0.25


class CommandProbe:
    """Commands the carriage of a machine that is free to move.

    Args:
        client: The node that commands.
        axes: Joints of the machine.
        probe: Hears the machine, and asks its services.
    """

    def __init__(self, client: AsyncClient, axes: MachineAxes, probe: Probe) -> None:
        self._axes = axes
        self._probe = probe
        self._publisher = topics.JOINT_TARGETS.advertise(client.node)

    async def findings(self, running: tuple[float, float], stop_within: float) -> list[Finding]:
        """Return what the machine does with commands; nothing where it takes none.

        Args:
            running: Angular speed [rad/s] and feed speed [m/s] when it winds.
            stop_within: Longest time to standstill [s].
        """
        try:
            await self._probe.until(self._heard, 1.0, "listener")
        except TimeoutError:
            return []
        feed = running[1]
        return [
            await self._before_the_start(feed),
            await self._probe.begins("rig/start", running),
            await self._late(feed),
            await self._followed(_SHARE * feed),
            await self._lost(running, DEAD_MAN + stop_within),
        ]

    def _heard(self) -> bool:
        return int(self._publisher.get_subscription_count()) > 0

    async def _before_the_start(self, feed: float) -> Finding:
        moved = await self._command(_LISTEN, lambda since: (feed * (1.0 + since), feed))
        return Finding(
            promise="rig/joint_targets before rig/start: change nothing",
            kept=abs(moved) <= MOTION[1],
            measured=f"the carriage moved {moved / MILLIMETRE:.3f} mm",
        )

    async def _late(self, feed: float) -> Finding:
        moved = await self._command(_LISTEN, lambda _: (0.0, 0.0), late=_LATE)
        return Finding(
            promise=f"rig/joint_targets stamped {_LATE:g} s ago: change nothing",
            kept=abs(moved - feed * _LISTEN) <= 0.5 * feed * _LISTEN,
            measured=f"the carriage moved {moved / MILLIMETRE:.3f} mm in {_LISTEN:g} s",
        )

    async def _followed(self, speed: float) -> Finding:
        moved = await self._command(_FOLLOWED, lambda since: (speed * since, speed))
        wanted = speed * _FOLLOWED
        return Finding(
            promise="rig/joint_targets while it winds: the carriage goes where it is commanded",
            kept=abs(moved - wanted) <= _TOLERANCE * wanted,
            measured=f"{moved / MILLIMETRE:.3f} mm of {wanted / MILLIMETRE:.3f} mm",
        )

    async def _lost(self, running: tuple[float, float], within: float) -> Finding:
        took, late = await self._probe.takes(
            lambda value: stands(value, running), 2.0 * within, "standstill"
        )
        _, omega, _, feed = self._probe.encoder.values[-1]
        going = f"{late}; it went on at {omega:.3g} rad/s and {feed / MILLIMETRE:.3g} mm/s"
        # A stop that nobody has asked for may be latched.
        await self._probe.ask("rig/stop" if late else "rig/reset")
        return Finding(
            promise=f"rig/joint_targets end in motion: both axes stand within {within:g} s",
            kept=not late and took <= within,
            measured=going if late else f"after {took:.2f} s",
        )

    async def _command(
        self, seconds: float, wanted: Callable[[float], tuple[float, float]], late: float = 0.0
    ) -> float:
        """Send ways [m] and speeds [m/s] by the time since the first; return the way gone [m].

        Args:
            seconds: For how long [s].
            wanted: Returns the way from where the carriage is at first, and the speed.
            late: How much older than the machine's newest sample they are stamped [s].
        """
        first, scale = self._place, self._axes.carriage_scale
        begin = self._probe.encoder.stamps[-1]
        while (now := self._probe.encoder.stamps[-1]) - begin < seconds:
            way, speed = wanted(now - begin)
            position = (first + way) / scale + self._axes.carriage_offset
            target = AxisTarget(position=position, speed=speed / scale)
            message = encode_targets(JointTargets(t=now - late, axes={CARRIAGE: target}))
            message.name = [self._axes.carriage_joint]
            self._publisher.publish(message)
            await asyncio.sleep(_PERIOD)
        return self._place - first

    @property
    def _place(self) -> float:
        return self._probe.encoder.values[-1][2]
