"""The link to the PLC: up or lost, since when, when to try again, and both heartbeats."""

from winding_plc_driver.machine.mapping import EMERGENCY_STOP, QUICK_STOP, STOP, Heartbeat, Server

_COUNTER = 2**15  # Fits the smallest counter that a PLC has for it
_STOPS = (STOP, QUICK_STOP, EMERGENCY_STOP)  # The later, the stronger


class Link:
    """State of the link."""

    def __init__(self, server: Server, now: float) -> None:
        self.up = False  # Whether commands and values pass
        self.losses = 0  # Times that it was lost
        self.reason = "not reached yet"  # Why it is not up
        self.owed = ""  # The stop that was asked for while it was not up; empty for none
        self._server = server
        self._lost_at = now
        self._established = self._stopped = False
        self._failures = 0

    def failed(self, reason: str) -> float:
        """Note an attempt that failed; return the wait until the next one [s]."""
        self.reason = reason
        wait = self._server.reconnect_wait_s * 2.0 ** min(self._failures, 30)
        self._failures += 1
        return min(wait, self._server.reconnect_wait_max_s)

    def lost(self, now: float, reason: str) -> None:
        """Note at a monotonic time [s] that the link is lost."""
        if self.up:
            self.up = False
            self.losses += 1
            self._lost_at = now
        self.reason = reason

    def stop_on_return(self, now: float) -> str:
        """Return the stop that is sent when the machine is reached at a monotonic time [s].

        Empty when it may go on.
        """
        limit = self._server.stop_after_link_loss_s
        if self._established and not self._stopped and 0.0 < limit < now - self._lost_at:
            return self.owed or STOP
        return self.owed

    def stopped(self, stop: str) -> None:
        """Note that a stop was sent; a stronger one may be owed meanwhile."""
        self._stopped = True
        if self.owed == stop:
            self.owed = ""

    def established(self) -> None:
        """Note that values and commands pass from now on."""
        self.up = self._established = True
        self._stopped = False
        self._failures = 0
        self.reason = ""

    def complaint(self, now: float) -> str:
        """Return why nothing passes at a monotonic time [s]; empty when the link is up."""
        if self.up:
            return ""
        since = "lost" if self._established else "down"
        return (
            f"the link to the PLC at {self._server.endpoint} has been {since} for "
            f"{now - self._lost_at:.1f} s: {self.reason}"
        )

    def refuse(self, command: str, now: float) -> str:
        """Return why a command does not pass at a monotonic time [s]; empty when it does.

        A stop that does not pass is owed to the machine.
        """
        if self.up:
            return ""
        sentence = self.complaint(now)
        if command not in _STOPS:
            return sentence
        self.owed = max(self.owed, command, key=("", *_STOPS).index)
        return f"{sentence}; {self.owed} is sent when the link returns"


class HeartbeatWatch:
    """Watches the PLC's counter, and counts for the driver."""

    def __init__(self, heartbeat: Heartbeat) -> None:
        self.seen: object = None  # The PLC's newest value; None before the first
        self.count = 0  # The driver's own counter
        self._heartbeat = heartbeat
        self._changed_at: float | None = None

    def restart(self, now: float) -> None:
        """Give the PLC its time again from a monotonic time [s] on."""
        self._changed_at = now

    def see(self, value: object, now: float) -> None:
        """Note the PLC's counter at a monotonic time [s]."""
        if value != self.seen:
            self.seen = value
            self._changed_at = now

    def advance(self) -> int:
        """Return the next value of the driver's counter, which stays below 2^15."""
        self.count = (self.count + 1) % _COUNTER
        return self.count

    def complaint(self, now: float) -> str:
        """Return that the PLC's program stands at a monotonic time [s]; empty while it runs."""
        silent = now - self._changed_at if self._changed_at is not None else 0.0
        if not self._heartbeat.read or silent <= self._heartbeat.timeout_s:
            return ""
        return (
            f"the PLC's heartbeat has stood at {self.seen} for {silent:.1f} s, more than "
            f"{self._heartbeat.timeout_s:g} s: its program does not run"
        )
