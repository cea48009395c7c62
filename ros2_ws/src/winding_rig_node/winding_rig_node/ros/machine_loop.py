"""The machine in a thread of its own with absolute deadlines, and the camera in another."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass

from winding_core.machine.watch_clock import WatchClock
from winding_rig_node.lay.lay_law import MotionLay
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import SAMPLE_RATE, Phase
from winding_rig_node.machine.pace import Pace
from winding_rig_node.ros.camera import Camera, exposure_of
from winding_rig_node.ros.outputs import Outputs
from winding_rig_node.ros.parameters import RigParameters

_POLL = 0.1
_STEP_POLL = 0.01
# A quick stop takes 0.3 s; a machine that does not come to rest may not keep its process.
_REST_PATIENCE = 0.6
_SAMPLE_PERIOD = 1.0 / SAMPLE_RATE
# Samples are published in bursts of a frame's length: each wake-up of a 1 kHz loop, and of those
# that read it, costs as much as several messages.
_BURST = 5
_ROUNDING = 1.0e-6  # Stamps come back as seconds in binary: a microsecond decides nothing at 1 kHz


@dataclass(eq=False)
class MachineLoop:
    """Advances the machine as fast as the clock, the paced topics and the camera allow.

    Every method may be called from any thread.
    """

    wanted: RigParameters  # Speed of simulated time, patience with its readers and the supervisor
    machine: Machine  # What is advanced
    pace: Pace  # What the readers have answered
    outputs: Outputs  # Publishers
    camera: Camera | None  # Takes its pictures in a second thread; None for a camera elsewhere
    lay: MotionLay | None  # What the machine winds; None for a lay that is known ahead
    _: KW_ONLY
    # Called, from the machine's thread, when a run has reached its end
    finished: Callable[[], None]
    warn: Callable[[str], None]  # Receives the sentence of a stop that was not requested
    fail: Callable[[Exception], None]  # Receives what ended a thread

    def __post_init__(self) -> None:
        self._frame_period = self.wanted.frame_period
        self._changed = threading.Condition()
        self._threads: list[threading.Thread] = []
        self._quit = False
        self._failed = False
        self._watch = WatchClock()
        self._supervisor_heard = math.inf

    @property
    def running(self) -> bool:
        """Whether the threads have been started and not ended."""
        return bool(self._threads)

    def begin(self) -> None:
        """Start the threads; time waits for the machine to be started."""
        self._quit = False
        if self.lay is not None:
            # What was exposed last before a halt may not have reached the camera.
            self.lay.renew_view()
        self._threads = [threading.Thread(target=self._guard(self._run), name="machine")]
        camera = self.camera
        if camera is not None:
            take = self._guard(lambda: camera.run(self._going))
            self._threads.append(threading.Thread(target=take, name="camera"))
        for thread in self._threads:
            thread.start()

    def end(self) -> None:
        """Bring the axes to rest and stop the threads."""
        self.come_to_rest()
        with self._changed:
            self._quit = True
            self._changed.notify_all()
        for thread in self._threads:
            thread.join()
        self._threads = []

    def command(self, act: Callable[[Machine], None]) -> None:
        """Do something to the machine between two of its steps.

        Raises:
            PhaseError: The machine cannot do this in its present phase.
        """
        with self._changed:
            act(self.machine)
            self._changed.notify_all()

    def start(self, machine: Machine) -> None:
        """Begin or resume winding; for `command`."""
        self.hear_supervisor()
        # A client repeats a request whose answer was lost: starting twice is starting once.
        if machine.state.phase is not Phase.WINDING:
            self.pace.begin(machine.time)
        machine.start()

    def reset(self, machine: Machine) -> None:
        """Go back to the start of a run, with a bare cylinder; for `command`."""
        machine.reset()
        if self.lay is not None:
            self.lay.restart()

    def answer(self, topic: str, t: float) -> None:
        """Note that the publisher of a paced topic has dealt with everything up to t [s]."""
        with self._changed:
            self.pace.answer(topic, t)
            self._changed.notify_all()

    def hear_supervisor(self) -> None:
        """Note a sign of life of the orchestrator."""
        self._supervisor_heard = self._watch.time

    def stop_quickly(self, reason: str) -> None:
        """Stop a machine that winds, for a reason."""
        if self.machine.state.phase is not Phase.WINDING:
            return
        self.command(lambda machine: machine.quick_stop(reason))
        self.warn(f"stopped both axes: {reason}")

    def come_to_rest(self) -> None:
        """Stop both axes, and wait until they stand."""
        if not self.running:
            return
        with self._changed:
            self.machine.quick_stop("the node ends")
            self._changed.notify_all()
            end = time.monotonic() + _REST_PATIENCE
            while self.machine.moving and not self._failed and time.monotonic() < end:
                self._changed.wait(_STEP_POLL)

    def _going(self) -> bool:
        return not self._quit

    def _guard(self, work: Callable[[], None]) -> Callable[[], None]:
        def run() -> None:
            try:
                work()
            except Exception as error:  # noqa: BLE001 - handed to the executor's thread
                self._failed = True
                self.fail(error)

        return run

    def _run(self) -> None:
        machine = self.machine
        begun = machine.state.drive_sample > 0
        deadline = time.monotonic()
        while not self._quit:
            with self._changed:
                if not machine.moving:
                    self._changed.notify_all()
                    self._changed.wait(_POLL)
                    deadline = time.monotonic()
                    continue
            self._check_supervisor()
            if not begun:
                self._emit()
                begun = True
            if not self._wait_for_consumers():
                continue
            deadline = self._wait_for_deadline(deadline)
            with self._changed:
                known, remarked = machine.state.reason, machine.remark
                self._step()
            if machine.state.reason != known:
                self.warn(f"stopped both axes: {machine.state.reason}")
            # Numbers in a remark change from step to step: it is logged when it begins.
            if machine.remark and not remarked:
                self.warn(machine.remark)
            self._emit()
            if machine.state.phase is Phase.FINISHED:
                self.finished()

    def _step(self) -> None:
        """Move the machine on by a sample, and the cable with it."""
        self.machine.step()
        if self.lay is not None:
            axes = self.machine.true_reading()
            pull = self.machine.pull
            self.lay.advance(axes.cylinder_angle, axes.carriage_position, pull, axes.guide)

    def _check_supervisor(self) -> None:
        limit = self.wanted.supervisor_timeout
        silence = self._watch.look(time.monotonic()) - self._supervisor_heard
        if limit > 0.0 and silence > limit:
            self.stop_quickly(f"no sign of life of the orchestrator for {limit:g} s")

    def _wait_for_consumers(self) -> bool:
        """Return whether time may go on; False when the loop ends meanwhile."""
        last_answer = time.monotonic()
        with self._changed:
            while self.machine.time + _SAMPLE_PERIOD > self.pace.limit + _ROUNDING:
                # A machine that has to stand soon waits for no reader.
                if self._quit or self.machine.hurried:
                    break
                self._check_supervisor()
                if self._changed.wait(_POLL):
                    last_answer = time.monotonic()
                elif time.monotonic() - last_answer > self.wanted.pace_timeout:
                    raise TimeoutError(
                        f"no answer on {self.pace.slowest} for {self.wanted.pace_timeout:g} s at "
                        f"{self.machine.time:.3f} s of simulated time"
                    )
        return not self._quit

    def _wait_for_deadline(self, deadline: float) -> float:
        """Sleep until the next burst is due; return the deadline of the next sample."""
        speed = self.wanted.speed
        if speed == 0.0:
            return deadline
        if self.machine.state.drive_sample % _BURST == 0:
            time.sleep(max(0.0, deadline - time.monotonic()))
        return deadline + 1.0 / (SAMPLE_RATE * speed)

    def _emit(self) -> None:
        self.outputs.sample(self.machine)
        if self.camera is None or self.machine.state.drive_sample % self._frame_period:
            return
        self.camera.expose(exposure_of(self.machine, self.lay), self._going)
