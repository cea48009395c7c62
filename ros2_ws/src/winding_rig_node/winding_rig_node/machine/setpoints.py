"""What each axis is asked for: by the drive programme, or by an outside commander."""

from winding_core.machine.commanded_axis import CommandedAxis
from winding_core.machine.commands import CARRIAGE, CYLINDER
from winding_rig_node.machine.axis import AxisState
from winding_rig_node.machine.commander import Commander
from winding_rig_node.machine.machine_config import MachineConfig, MachineState, Phase, PhaseError

_POSITION_GAIN = 8.0  # Speed that an axis under commands is given per way behind its setpoint [1/s]


class Setpoints:
    """Setpoints of both axes."""

    def __init__(self, config: MachineConfig, state: MachineState, commander: Commander) -> None:
        self._config = config
        self._state = state
        self._commander = commander
        self._programme = {CYLINDER: config.drive.angular_speed, CARRIAGE: config.drive.feed_speed}

    def now(self, name: str) -> tuple[float, float]:
        """Return position [rad or m] and speed [rad/s or m/s] that an axis is asked for."""
        axis = self._commander.axes.get(name)
        if axis is not None:
            return axis.position, axis.speed
        full, state = self._programme[name], self._state
        return full * state.full_speed_time + state.origins.get(name, 0.0), full * state.fraction

    def advance(self, name: str, measured: float, dt: float, *, hurried: bool) -> tuple[float, ...]:
        """Move an axis's setpoint on by dt [s].

        Args:
            name: The axis.
            measured: Position by its encoder [rad or m].
            dt: Control period [s].
            hurried: Whether the machine is on its way to a standstill that nothing may delay.

        Returns:
            Speed [rad/s or m/s] and acceleration [rad/s^2 or m/s^2] for its drive.
        """
        axis = self._commander.axes.get(name)
        state = self._state
        if axis is None:
            full = self._programme[name]
            return full * state.fraction, full * state.fraction_rate
        if state.phase is Phase.WINDING:
            behind = axis.position - measured
            axis.advance(state.time, dt)
            return axis.speed + _POSITION_GAIN * behind, axis.acceleration
        deceleration = axis.limits.acceleration
        if hurried:
            deceleration = max(deceleration, axis.limits.speed / self._config.quick_stop_time)
        axis.brake(deceleration, dt)
        return axis.speed, axis.acceleration

    def full_speeds(self) -> tuple[float, ...]:
        """Return how fast cylinder [rad/s] and carriage [m/s] may go now."""
        under = self._commander.axes
        return tuple(
            max(abs(full), under[name].limits.speed) if name in under else abs(full)
            for name, full in self._programme.items()
        )

    def as_taken_over(self) -> dict[str, CommandedAxis]:
        """Return both axes as a commander would take them over now, by name."""
        commands, state = self._config.commands, self._state

        def taken(name: str, axis: AxisState) -> CommandedAxis:
            limits = commands.cylinder if name == CYLINDER else commands.carriage
            return CommandedAxis(limits, axis.encoder.position, self.now(name)[1])

        return {
            CYLINDER: taken(CYLINDER, state.cylinder),
            CARRIAGE: taken(CARRIAGE, state.carriage),
        }

    def take_back(self) -> None:
        """Give commanded axes back to the drive programme, which goes on from where they stand.

        Raises:
            PhaseError: One of them is coming to rest still.
        """
        if not self._commander.standing:
            raise PhaseError("cannot start while a commanded axis is coming to rest")
        for name, axis in self._commander.axes.items():
            way = self._programme[name] * self._state.full_speed_time
            self._state.origins[name] = axis.position - way
        self._commander.release()
