"""ROS adapter of the learned weight: predicted and measured markers in, corrected lengths out."""

from __future__ import annotations

from typing import Any

import numpy as np
from sensor_msgs.msg import PointCloud2

from cable_winding.markers import MARKER_DTYPE, is_wound
from cable_winding.ros import topics
from cable_winding.ros.cloud_messages import decode_cloud, encode_cloud
from cable_winding.ros.diagnostic_messages import Level, Status, encode_case_votes
from cable_winding.ros.managed_node import ManagedNode
from correction_node.corrector import Corrector
from correction_node.neighbours import MARKERS
from correction_node.parameters import CorrectionParameters
from correction_node.weights import load_weight, weights_directory


class CorrectionNode(ManagedNode[CorrectionParameters]):
    """Multiplies predicted lengths by the learned weight h, and names the case the run resembles.

    Subscribes to fem/markers and tracker/markers. Publishes correction/markers with each
    fem/markers, and correction/case whenever a further marker has been measured.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(topics.CORRECTION, CorrectionParameters, **kwargs)

    def configure(self) -> None:
        """Load the weight; advertise and subscribe."""
        self._case = self.configuration.condition()
        weight = load_weight(weights_directory(self.configuration.weights))
        self._errors = weight.card["errors"]["network"]
        self._corrector = Corrector(weight)
        self._factor = self._corrector.factor(self._case)
        self._refusals: tuple[str, ...] = ()
        self._markers_out = self.advertise(topics.CORRECTED_MARKERS)
        self._case_out = self.advertise(topics.CORRECTION_CASE)
        self.subscribe(topics.FEM_MARKERS, self._on_prediction)
        self.subscribe(topics.TRACKED_MARKERS, self._on_measurement)

    def activate(self) -> None:
        """Begin a new run: nothing has been measured yet."""
        self._measured: frozenset[int] = frozenset()
        now = self.get_clock().now().nanoseconds * 1e-9
        self._case_out.publish(encode_case_votes(now, {}))

    def status(self) -> Status:
        """Return the weight in use and what speaks against it."""
        factor = getattr(self, "_factor", None)
        if factor is None:
            return Status(name=topics.CORRECTION, message="not configured")
        against = [*([factor.outside] if factor.outside else []), *self._refusals]
        return Status(
            name=topics.CORRECTION,
            level=Level.WARN if against else Level.OK,
            message="; ".join(against) or "correcting",
            values={
                "h": f"{factor.h:.6f}",
                "relative_bound": f"{factor.relative_bound:.6f}",
                "weights": self.configuration.weights,
                "in_sample_pct": f"{self._errors['in_sample_pct']:.2f}",
                "leave_one_case_out_pct": f"{self._errors['leave_one_case_out_pct']:.2f}",
            },
        )

    def _on_prediction(self, message: PointCloud2) -> None:
        t, markers = decode_cloud(message, MARKER_DTYPE)
        self._refusals = self._corrector.refusals(markers)
        self._markers_out.publish(encode_cloud(t, self._corrector.correct(markers, self._case)))

    def _on_measurement(self, message: PointCloud2) -> None:
        t, markers = decode_cloud(message, MARKER_DTYPE)
        known = (markers["id"] > 0) & (markers["id"] <= MARKERS)
        wound = markers[is_wound(markers) & known]
        seen = frozenset(int(marker) for marker in wound["id"])
        if not seen or seen == self._measured:
            return
        self._measured = seen
        lengths = np.full(MARKERS, np.nan)
        lengths[wound["id"] - 1] = wound["s"]
        self._case_out.publish(encode_case_votes(t, self._corrector.classify(lengths).votes))
