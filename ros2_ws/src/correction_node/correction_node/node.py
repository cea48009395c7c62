"""ROS adapter of the correction: predicted and measured markers in, corrected lengths out."""

from typing import Any

from correction_node.live.run_corrector import RunCorrector
from correction_node.ros.message_handler import CorrectionHandler
from correction_node.ros.parameters import CorrectionParameters
from winding_core.status import Level, Status
from winding_ros import graph, topics
from winding_ros.runtime.managed_node import ManagedNode


class CorrectionNode(ManagedNode[CorrectionParameters]):
    """Corrects predicted lengths, and names the case the run resembles.

    Before anything is measured a length is h times the prediction, h being the learned factor;
    afterwards it follows from the markers measured before it. `/diagnostics` reports which
    under ``basis``.

    Subscribes to fem/markers and tracker/markers. Publishes correction/markers with each
    fem/markers, and correction/case whenever a further marker has been measured.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(graph.CORRECTION, CorrectionParameters, **kwargs)

    @property
    def run(self) -> RunCorrector:
        """What is measured of this run; from `configure` on."""
        return self._handler.run

    def configure(self) -> None:
        """Load the factor; subscribe."""
        self._handler = CorrectionHandler(self.configuration)
        self.endpoints.connect(self._handler)

    def activate(self) -> None:
        """Begin a new run: nothing has been measured yet."""
        self.publish(self._handler.begin(self.get_clock().now().nanoseconds * 1e-9))

    def status(self) -> Status:
        """Return the factor in use and what speaks against it."""
        handler: CorrectionHandler | None = getattr(self, "_handler", None)
        if handler is None:
            return Status(name=topics.CORRECTION, message="not configured")
        factor, run = handler.factor, handler.run
        refused = run.measured.refused
        against = [
            *([run.outside] if run.outside else []),
            *run.refusals,
            *(
                [f"refused {refused} measured markers, the last: {run.measured.last_refusal}"]
                if refused
                else []
            ),
        ]
        basis = "weight"
        if run.basis:
            basis = "measured " + ", ".join(f"P{marker}" for marker in run.basis)
        return Status(
            name=topics.CORRECTION,
            level=Level.WARN if against else Level.OK,
            message="; ".join(against) or f"correcting by {basis}",
            values={
                "basis": basis,
                "h": f"{factor.h:.6f}",
                "relative_bound": f"{factor.relative_bound:.6f}",
                "refused_measurements": str(refused),
                "weights": self.configuration.weights,
                "weights_sha256": handler.digest,
                "learned_from": handler.learned_from,
                "condition": run.outside or "inside the conditions that were learned from",
                "in_sample_pct": f"{handler.errors['in_sample_pct']:.2f}",
                "leave_one_case_out_pct": f"{handler.errors['leave_one_case_out_pct']:.2f}",
            },
        )
