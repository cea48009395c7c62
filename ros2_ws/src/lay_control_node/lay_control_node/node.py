"""ROS adapter of the lay controller: measured lay in, commands of guide and brake out."""

import json
import time
from collections.abc import Callable
from typing import Any

from lay_control_node.control.cadence import LONGEST_GAP
from lay_control_node.ros.command_carrier import CommandCarrier
from lay_control_node.ros.message_handler import Clocks, LayControlHandler
from lay_control_node.ros.parameters import LayControlParameters
from winding_core.lay.layers import FULL_TURN
from winding_core.lay.records import ControlBasis, ControlMode
from winding_core.status import Level, Status
from winding_ros import graph, services, topics
from winding_ros.runtime.managed_node import ManagedNode

# A carriage that is so much of the following error behind its setpoint does not follow.
_BEHIND = 0.8
# A status carries the newest faults of layers.
_SHOWN_FAULTS = 20


class LayControlNode(ManagedNode[LayControlParameters]):
    """Commands guide and brake so that the cable lands where the lay program wants it.

    Subscribes to rig/joint_states, rig/tension, tracker/markers, tracker/lay and fem/markers.
    Publishes lay_control/state at 50 Hz and, while it drives, rig/joint_targets and
    rig/tension_command; targets also while joint states are late. Its three services switch what
    it does.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(graph.LAY_CONTROL, LayControlParameters, **kwargs)
        self._carrier: CommandCarrier | None = None
        for service, mode in (
            (services.LAY_CONTROL_OFF, ControlMode.OFF),
            (services.LAY_CONTROL_WATCH, ControlMode.WATCH),
            (services.LAY_CONTROL_DRIVE, ControlMode.DRIVE),
        ):
            service.serve(self, self._switched(mode))

    def configure(self) -> None:
        """Read the program, make the controller; subscribe."""
        # The simulated machine waits for its readers: a gap of simulated time is none of theirs.
        waits = self.get_parameter("use_sim_time").value
        clocks = None if waits else Clocks(now=time.monotonic, arrived=self._arrived)
        self._handler = LayControlHandler(self.configuration, clocks)
        self.endpoints.connect(self._handler)

    def activate(self) -> None:
        """Begin a new run."""
        self.publish(self._handler.begin(self.get_clock().now().nanoseconds * 1e-9))
        if not self.get_parameter("use_sim_time").value:
            self._carrier = CommandCarrier(self._handler.carried, self.publish, time.monotonic)

    def deactivate(self) -> None:
        """Command nothing any more."""
        if self._carrier is not None:
            self._carrier.close()
            self._carrier = None

    def _arrived(self) -> float:
        return 1.0e-9 * self.endpoints.arrived_ns

    def status(self) -> Status:
        """Return what the controller does, and what it knows."""
        handler: LayControlHandler | None = getattr(self, "_handler", None)
        if handler is None:
            return Status(name=topics.LAY_CONTROL, message="not configured")
        mode, newest = handler.controller.mode, handler.newest
        if newest is None:
            return Status(
                name=topics.LAY_CONTROL,
                message=f"{mode.name.lower()}; waiting",
                values={"mode": mode.name.lower()},
            )
        lay = newest.lay
        cadence = handler.cadence
        fallen = mode is ControlMode.DRIVE and newest.basis in (
            ControlBasis.RAMP,
            ControlBasis.LATE,
        )
        basis = {
            ControlBasis.MEASURED: "by the measured lay",
            ControlBasis.MODEL: "by the model: no lay has been measured for 1.5 turns",
            ControlBasis.RAMP: "by the drive programme: the solver is silent",
            ControlBasis.LATE: f"by the drive programme: for {cadence.unplanned:.2f} s, more than "
            f"{LONGEST_GAP:g} s, no command was planned; joint states came at most "
            f"{cadence.largest_of_readings:.2f} s apart",
        }[newest.basis]
        stays = (
            newest.commanding and abs(newest.ahead) > _BEHIND * self.configuration.following_error
        )
        if stays:
            basis += f"; the carriage stands {1e3 * newest.ahead:.1f} mm behind its setpoint"
        layers: dict[str, str] = {}
        watch, faults = handler.controller.watch, []
        if watch is not None:
            layer, faults = watch.layer_at(newest.theta), watch.faults
            share = watch.measured_share(layer.number)
            layers = {
                "layer": str(layer.number),
                "turn_of_layer": f"{newest.theta / FULL_TURN - layer.first_turn + 1.0:.2f}",
                "measured_share_of_layer": f"{share:.2f}",
                "layer_turns": json.dumps(watch.layer_turns),
                "newest_layer_fault": faults[-1].sentence if faults else "",
                "layer_faults": json.dumps([fault.record() for fault in faults[-_SHOWN_FAULTS:]]),
            }
            basis += f"; layer {layer.number}"
            basis += "".join(f"; {fault.sentence}" for fault in faults[-1:])
        unseen = mode is ControlMode.DRIVE and newest.basis is ControlBasis.MODEL
        return Status(
            name=topics.LAY_CONTROL,
            level=Level.WARN if fallen or unseen or stays or faults else Level.OK,
            message=f"{mode.name.lower()}, {basis}",
            values={
                "mode": mode.name.lower(),
                "basis": newest.basis.name.lower(),
                "largest_gap_s": f"{cadence.largest:.3f}",
                "largest_unplanned_s": f"{cadence.unplanned:.3f}",
                "largest_gap_of_joint_states_s": f"{cadence.largest_of_readings:.3f}",
                "error_mm": f"{1e3 * (lay.z - newest.wanted_z):.3f}",
                "sigma_mm": f"{1e3 * lay.sigma_z:.3f}",
                "free_length_mm": f"{1e3 * lay.free_length:.1f}",
                "free_length_sigma_mm": f"{1e3 * lay.sigma_length:.1f}",
                "load_share": f"{newest.stretch.share:.3f}",
                "drag_n": f"{newest.stretch.drag:.3f}",
                **layers,
            },
        )

    def _switched(self, mode: ControlMode) -> Callable[[Any, Any], Any]:
        def serve(_request: Any, response: Any) -> Any:
            handler: LayControlHandler | None = getattr(self, "_handler", None)
            if handler is None or not self.active:
                response.message = f"{topics.LAY_CONTROL} is not active"
                return response
            handler.switch(mode)
            response.success = True
            response.message = f"the controller of the lay is set to {mode.name.lower()}"
            return response

        return serve
