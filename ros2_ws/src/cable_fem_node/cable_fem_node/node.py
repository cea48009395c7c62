"""ROS adapter of the solver: the machine's motion in, cable and markers out."""

from __future__ import annotations

from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from cable_fem_node.parameters import FemParameters
from cable_fem_node.prediction import predict
from cable_fem_node.rod_winding import RodWinding
from cable_fem_node.winding_config import WindingConfig
from cable_winding.markers import CABLE_DTYPE
from cable_winding.ros import topics
from cable_winding.ros.cloud_messages import encode_cloud, encode_line_strip
from cable_winding.ros.diagnostic_messages import Level, Status
from cable_winding.ros.managed_node import ManagedNode
from cable_winding.ros.rig_messages import decode_joint_state, decode_tension


class CableFemNode(ManagedNode[FemParameters]):
    """Shadows the machine with the explicit rod, and predicts the whole run ahead.

    Subscribes to rig/joint_states and rig/tension. Publishes fem/markers, fem/cable,
    fem/cable_line in step with the machine, and fem/prediction once at activation.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(topics.FEM, FemParameters, **kwargs)

    def configure(self) -> None:
        """Build the model; advertise and subscribe."""
        wanted = self.configuration
        self._config = WindingConfig(
            case=wanted.condition(),
            friction=wanted.friction,
            law=wanted.law,
            segment_length=wanted.segment_length,
            free_length=wanted.free_length,
            mass_scaling=wanted.mass_scaling,
            rolling=wanted.rolling,
        )
        self._prediction = predict(self._config, wanted.drive(), wanted.duration)
        self._markers_out = self.advertise(topics.FEM_MARKERS)
        self._cable_out = self.advertise(topics.FEM_CABLE)
        self._line_out = self.advertise(topics.FEM_CABLE_LINE)
        self._prediction_out = self.advertise(topics.FEM_PREDICTION)
        self.subscribe(topics.TENSION, self._on_tension)
        self.subscribe(topics.JOINT_STATES, self._on_joint_state)

    def activate(self) -> None:
        """Begin a new run; publish its prediction."""
        self._model = RodWinding(self._config)
        self._start: float | None = None
        self._tension: float | None = None
        self._markers_due = self._cable_due = 0.0
        now = self.get_clock().now().nanoseconds * 1e-9
        self._prediction_out.publish(encode_cloud(now, self._prediction.markers))

    def status(self) -> Status:
        """Return the model's time and energy balance."""
        model = getattr(self, "_model", None)
        if model is None:
            return Status(name=topics.FEM, message="not active")
        balance = model.energy.balance_pct
        return Status(
            name=topics.FEM,
            level=Level.OK if balance <= 1.0 else Level.WARN,
            message="following the machine" if self._start is not None else "waiting",
            values={"time": f"{model.time:.3f}", "energy_balance_pct": f"{balance:.3f}"},
        )

    def _on_tension(self, message: WrenchStamped) -> None:
        _, force = decode_tension(message)
        if self.configuration.follow_tension:
            self._tension = max(force, 0.0)

    def _on_joint_state(self, message: JointState) -> None:
        t, reading = decode_joint_state(message)
        if self._start is None:
            self._start = t
            self._markers_due = self._cable_due = t
        self._model.advance_to(
            t - self._start,
            cylinder_angle=reading.cylinder_angle,
            angular_speed=reading.angular_speed,
            guide_z=reading.carriage_position,
            feed_speed=reading.feed_speed,
            tension=self._tension,
        )
        if t >= self._markers_due:
            self._markers_due += _period(topics.FEM_MARKERS)
            self._markers_out.publish(encode_cloud(t, self._model.markers()))
        if t >= self._cable_due:
            self._cable_due += _period(topics.FEM_CABLE)
            cable = _published(self._model.cable())
            self._cable_out.publish(encode_cloud(t, cable))
            points = np.stack([cable["x"], cable["y"], cable["z"]], axis=1).astype(float)
            self._line_out.publish(encode_line_strip(t, points, self._config.case.cable_diameter))


def _period(topic: topics.Topic) -> float:
    assert topic.rate is not None
    # Half a sample early, so that rounding never makes an instant late.
    return 1.0 / topic.rate - 1.0e-9


def _published(cable: NDArray[np.void]) -> NDArray[np.void]:
    records = np.zeros(cable.shape, dtype=CABLE_DTYPE)
    for name in CABLE_DTYPE.names or ():
        records[name] = cable[name]
    return records
