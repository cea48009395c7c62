"""Predicted and measured markers in, corrected lengths and the resembling case out."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from correction_node.live.corrector import Corrector
from correction_node.live.neighbours import MARKERS
from correction_node.live.run_corrector import RunCorrector
from correction_node.live.within_run import published_within_run
from correction_node.models.factor_models import ProcessModel
from correction_node.models.weights import load_factor, weights_directory
from correction_node.ros.parameters import CorrectionParameters
from winding_core.markers import MARKER_DTYPE
from winding_ros import topics
from winding_ros.messages.clouds import decode_cloud, encode_cloud
from winding_ros.messages.diagnostics import encode_case_votes
from winding_ros.runtime.message_handler import Answer
from winding_ros.topic import Topic


class CorrectionHandler:
    """Corrects predicted lengths by factor and measurement; names the case the run resembles."""

    def __init__(self, wanted: CorrectionParameters) -> None:
        what = wanted.resolved()
        condition = what.case
        trained = load_factor(weights_directory(wanted.weights))
        self.errors = trained.errors  # Of the factor, from its card
        self.digest: str = trained.card["weights_sha256"]  # SHA-256 of the learned numbers, in hex
        data = trained.card["data"]
        of = "runs" if isinstance(trained.model, ProcessModel) else "cases"
        # Name of the data and their extent, in words.
        self.learned_from = f"{data['name']}, {data['cells']} lengths of {data['cases']} {of}"
        path = (what.drive.advance_per_radian, what.free_length)
        if trained.place is not None and not np.allclose(path, trained.place.configured):
            trained = replace(trained, place=None)
        # The law within a run is of the paper's rig.
        law = None if isinstance(trained.model, ProcessModel) else published_within_run()
        self._corrector = Corrector(trained, law=what.law)
        # The correction factor h for this condition.
        self.factor = self._corrector.factor(condition)
        # The measured markers of this run, and what follows from them for the rest.
        self.run = RunCorrector(self._corrector, law, condition)
        self._reported: tuple[frozenset[int], frozenset[int], Mapping[int, float]]
        self._reported = (frozenset(), frozenset(), {})

    def begin(self, t: float) -> Iterator[Answer]:
        """Begin a new run at a time [s]: nothing has been measured yet."""
        self.run.forget()
        self._reported = (frozenset(), frozenset(), {})
        yield Answer(topic=topics.CORRECTION_CASE, message=encode_case_votes(t, {}))

    def take(self, topic: Topic, data: bytes) -> Iterator[Answer]:
        """Take predicted or measured markers; yield what they change.

        Raises:
            MessageError: The message cannot be used.
        """
        t, markers = decode_cloud(data, MARKER_DTYPE)
        if topic is topics.FEM_MARKERS:
            corrected = self.run.correct(t, markers)
            yield Answer(topic=topics.CORRECTED_MARKERS, message=encode_cloud(t, corrected))
            return
        self.run.measured.take(t, markers)
        yield from self._votes(t)

    def _votes(self, t: float) -> Iterator[Answer]:
        """Yield the resembling case when a further marker is measured or a length settles."""
        measured = self.run.measured
        seen, settled, votes = self._reported
        if not measured.seen or (measured.seen, measured.settled) == (seen, settled):
            return
        lengths = measured.lengths()
        if not np.isfinite(lengths[:MARKERS]).any():
            return
        now = self._corrector.classify(lengths).votes
        self._reported = (measured.seen, measured.settled, now)
        if measured.seen != seen or now != votes:
            yield Answer(topic=topics.CORRECTION_CASE, message=encode_case_votes(t, now))
