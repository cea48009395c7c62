"""ROS adapter of the solver: the machine's motion in, cable and markers out."""

import functools
import traceback
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.timer import Timer

from cable_fem_node.identification.live_material import (
    LiveMaterial,
    MaterialUpdate,
    load_search,
    work_out,
)
from cable_fem_node.ros.background import BackgroundTask, PredictionTask
from cable_fem_node.ros.message_handler import FemHandler
from cable_fem_node.ros.parameters import FemParameters
from cable_fem_node.winding.prediction import left_behind
from winding_core.cable.material_report import MaterialReport, refused_material
from winding_core.cable.wound_label import WoundLabel
from winding_core.markers import MARKER_DTYPE
from winding_core.status import Level, Status
from winding_ros import graph, topics
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.diagnostics import encode_material
from winding_ros.runtime.managed_node import ManagedNode

# How often the node looks whether a marker has landed or an identification has ended [s].
_LOOK_PERIOD = 0.05


class CableFemNode(ManagedNode[FemParameters]):
    """Shadows the machine with rod or solid, and predicts the whole run ahead with the rod.

    Subscribes to rig/joint_states, rig/tension and tracker/markers. Publishes fem/markers,
    fem/cable, fem/cable_line in step with the machine, fem/prediction at activation and again as
    more of a long run has been wound ahead, and fem/material whenever a further marker has
    landed. With `take_up_material` model and prediction go on with what is found, and
    fem/prediction comes again.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(graph.FEM, FemParameters, **kwargs)
        self._task: BackgroundTask[MaterialUpdate] | None = None
        self._live: LiveMaterial | None = None
        self._ahead: PredictionTask | None = None
        self._looker: Timer | None = None
        self._report: tuple[float, MaterialReport] | None = None

    def configure(self) -> None:
        """Build the model; subscribe."""
        self._handler = FemHandler(self.configuration, self.go_on, ahead_elsewhere=True)
        if self._handler.slowness:
            self.get_logger().warning(self._handler.slowness)
        if self.configuration.update_material:
            load_search()
        self.endpoints.connect(self._handler, extra={topics.TRACKED_MARKERS: self._on_tracked})
        # Wall time: an identification may end when the machine has stopped.
        self._looker = self.create_timer(
            _LOOK_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def activate(self) -> None:
        """Begin a new run; publish its prediction."""
        wanted, now = self.configuration, self.get_clock().now().nanoseconds * 1e-9
        self._abandon()
        self._report = None
        self.publish(self._handler.begin(now))
        self._ahead = PredictionTask(self._handler.ahead, now)
        self._live = LiveMaterial(
            self._handler.config,
            self._handler.drive,
            wanted.duration,
            take_up=wanted.take_up_material,
        )
        self.endpoints.publish(topics.FEM_MATERIAL, encode_material(now, None))

    def deactivate(self) -> None:
        """Let go of what is at work in the background."""
        self._abandon()
        self._live = None

    def cleanup(self) -> None:
        """Let go of what is at work in the background."""
        self._abandon()
        if self._looker is not None:
            self.destroy_timer(self._looker)
            self._looker = None

    def status(self) -> Status:
        """Return the model's time, its energy balance and the identified material."""
        handler: FemHandler | None = getattr(self, "_handler", None)
        if handler is None or handler.model is None:
            return Status(name=topics.FEM, message="not active")
        balance = handler.model.energy.balance_pct
        message = "following the machine" if handler.following else "waiting"
        values = {"time": f"{handler.model.time:.3f}", "energy_balance_pct": f"{balance:.3f}"}
        values["element"] = self.configuration.element
        laid = float(handler.model.wound_path()[1][-1])
        behind = left_behind(handler.model.cylinder_angle, laid)
        message = f"{message}; {behind}" if behind else message
        what = self.configuration.resolved()
        values |= WoundLabel.of(what, self.configuration.drum(what.case)).values()
        if handler.slowness:
            values["slowness"] = handler.slowness
        refused = False
        if self._report is not None:
            t, report = self._report
            refused = bool(report.refusal)
            values |= {f"material {key}": value for key, value in report.status().values.items()}
            values["material updated at"] = f"{t:.3f}"
            message = f"{message}; material refused: {report.refusal}" if refused else message
        if self._ahead is not None:
            values["predicted_to"] = f"{self._ahead.reached:.1f}"
            if self._ahead.failure:
                refused, message = True, f"{message}; prediction: {self._ahead.failure}"
        return Status(
            name=topics.FEM,
            level=Level.WARN if refused or behind or balance > 1.0 else Level.OK,
            message=message,
            values=values,
        )

    def _on_tracked(self, data: bytes) -> None:
        if self._live is not None and self.configuration.update_material:
            t, markers = decode_cloud(data, MARKER_DTYPE)
            self._tracked_until = t
            self._live.see(markers)

    def _look(self) -> None:
        """Publish predictions; begin the identification that is due, or take what one found."""
        if self._ahead is not None:
            self._publish_ahead(self._ahead)
        live, task = self._live, self._task
        if live is None:
            return
        if task is None:
            due = live.due(self._handler.history)
            if due is not None:
                self._markers_used = tuple(due.readings.ids.tolist())
                self._task = BackgroundTask(functools.partial(work_out, due))
        elif task.done:
            self._task = None
            self._take(self._tracked_until, live, task)

    def _publish_ahead(self, ahead: PredictionTask) -> None:
        failed = bool(ahead.failure)
        self.publish([self._handler.predicted(ahead.begun, found) for found in ahead.news()])
        if ahead.failure and not failed:
            self.get_logger().warning(f"prediction: {ahead.failure}")

    def _take(self, t: float, live: LiveMaterial, task: BackgroundTask[MaterialUpdate]) -> None:
        try:
            update = task.result()
        except Exception as error:  # noqa: BLE001 - the run goes on without an estimate
            self.get_logger().error(f"identification failed:\n{traceback.format_exc()}")
            update = MaterialUpdate(estimate=None, refusal=f"{type(error).__name__}: {error}")
        live.learn(update)
        if update.model is not None and update.ahead is not None:
            self._handler.go_on_with(update.model)
            if self._ahead is not None:
                self._ahead.abandon()
            self._ahead = PredictionTask(update.ahead, t)
        report = _reported(update, self._handler.config.law, self._markers_used)
        self._report = (t, report)
        self.endpoints.publish(topics.FEM_MATERIAL, encode_material(t, report))
        if report.refusal:
            self.get_logger().warning(f"material refused: {report.refusal}")

    def _abandon(self) -> None:
        if self._task is not None:
            self._task.abandon()
            self._task = None
        if self._ahead is not None:
            self._ahead.abandon()
            self._ahead = None


def _reported(update: MaterialUpdate, law: str, markers: tuple[int, ...]) -> MaterialReport:
    estimate = update.estimate
    if estimate is None:
        return refused_material(law, markers, update.refusal)
    return MaterialReport(
        law=estimate.law,
        young=estimate.young,
        standard_error=estimate.standard_error,
        half_width_90=estimate.half_width_90,
        markers=estimate.markers,
        worst_share=estimate.fit.worst_share,
        taken_up=update.model is not None,
        refusal=update.refusal,
    )
