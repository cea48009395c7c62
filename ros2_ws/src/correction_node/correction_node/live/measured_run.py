"""The markers of a run as the tracker has measured them, and which lengths no cable can have."""

from bisect import bisect_right
from statistics import median

import numpy as np

from correction_node.models.dataset import Array
from winding_core.cable.cases import Case
from winding_core.cable.material_law import TABLE_HIGH
from winding_core.markers import MarkerFlag, Markers, is_wound

# S counts the path at R + r. Cable that is pulled is at least as long as it was; the wound radius
# of a stretched one is smaller by less than this, and the solver's noise is far below.
SLACK = 0.05
# A length is known when this many frames have measured it. It is their median, which fewer than
# half of them cannot move out of the range of the others.
SETTLED_FRAMES = 9
_DOUBTFUL = (
    MarkerFlag.OCCLUDED
    | MarkerFlag.CLIPPED
    | MarkerFlag.TOUCHING
    | MarkerFlag.SLIPPED
    | MarkerFlag.PREDICTED
)


def implausible(wound: Markers, condition: Case) -> dict[int, str]:
    """Return one sentence for each record that cannot be right, by its index.

    A length must be finite, no shorter than the undeformed cable before the marker (5 % are
    given for thinning) and no longer than the material tables reach; markers must be numbered
    as the cable's are, once each, and lie one after the other along it.

    Args:
        wound: MARKER_DTYPE records of markers on the cylinder, shape (n,), in any order.
        condition: What is being wound.
    """
    found: dict[int, str] = {}
    last, last_marker = -np.inf, -1
    for index in np.argsort(wound["id"], kind="stable").tolist():
        marker, length = int(wound["id"][index]), float(wound["s"][index])
        sentence = _alone(marker, length, condition)
        if sentence is None and marker == last_marker:
            sentence = f"marker {marker} stands twice"
        if sentence is None and not length > last:
            sentence = (
                f"marker {marker} lies before marker {last_marker}: {length:.4g} m against "
                f"{last:.4g} m"
            )
        if sentence is None:
            last, last_marker = length, marker
        else:
            found[index] = sentence
    return found


def _alone(marker: int, length: float, condition: Case) -> str | None:
    if marker > condition.marker_count:
        return f"marker {marker} does not exist: this cable has {condition.marker_count}"
    if not np.isfinite(length) or length < 0.0:
        return f"marker {marker} has no usable length, got {length} m"
    original = condition.original_length(marker)
    if length < (1.0 - SLACK) * original:
        return (
            f"marker {marker} is shorter than physics allows: {length:.4g} m of cable that "
            f"measures {original:.4g} m unstretched"
        )
    if marker > 0 and length > TABLE_HIGH * original:
        return (
            f"marker {marker} is longer than the material's tables reach: {length:.4g} m of "
            f"cable that measures {original:.4g} m unstretched"
        )
    return None


class MeasuredRun:
    """Collects measured lengths, refuses what no cable can be.

    A length that is known stays what it is until its marker slips or a new run begins. What was
    known at which time is kept, so that it can be asked for afterwards.

    Attributes:
        refused: How many refusals there were in this run.
        last_refusal: The newest, as one sentence; empty without any.
    """

    def __init__(self, condition: Case) -> None:
        self._condition = condition
        self.forget()

    def forget(self) -> None:
        """Begin a new run."""
        self.refused = 0
        self.last_refusal = ""
        self._frames: list[list[float]] = [[] for _ in range(self._condition.marker_count)]
        self._stamps: list[float] = []
        self._known: list[Array] = []
        self._newest = -np.inf

    def take(self, t: float, markers: Markers) -> None:
        """Take the markers of one frame.

        A flagged marker is not a measurement. One that has slipped lies elsewhere now: what was
        measured of it is forgotten. A frame in which none of the measured markers is wound any
        more begins a new run, and so does a time before the last one.

        Args:
            t: Time of the frame [s].
            markers: MARKER_DTYPE records of the tracker, shape (n,).
        """
        wound = is_wound(markers)
        ended = len(markers) and not (wound & (markers["id"] > 0)).any()
        if t < self._newest or (self.seen and ended):
            self.forget()
        self._newest = t
        before = self.settled
        flags = markers["flags"]
        for marker in markers["id"][wound & ((flags & MarkerFlag.SLIPPED) != 0)].tolist():
            if 0 < marker <= len(self._frames):
                self._frames[marker - 1].clear()
        clear = markers[wound & ((flags & _DOUBTFUL) == 0)]
        refused = implausible(clear, self._condition)
        if refused:
            self.refused += len(refused)
            self.last_refusal = next(reversed(refused.values()))
        for row, (marker, s) in enumerate(
            zip(clear["id"].tolist(), clear["s"].tolist(), strict=True)
        ):
            if marker > 0 and row not in refused and marker not in before:
                self._frames[marker - 1].append(s)
        if self.settled != before:
            self._stamps.append(t)
            self._known.append(self.lengths(frames=SETTLED_FRAMES))

    @property
    def seen(self) -> frozenset[int]:
        """Numbers of the markers that at least one frame has measured."""
        return self._with_frames(1)

    @property
    def settled(self) -> frozenset[int]:
        """Numbers of the markers whose length is known."""
        return self._with_frames(SETTLED_FRAMES)

    def lengths(self, *, frames: int = 1) -> Array:
        """Return S_1, S_2, ... [m] as of now, shape (marker_count,).

        NaN where fewer frames than asked have measured a marker.
        """
        enough = self._with_frames(frames)
        return np.array(
            [median(s) if n in enough else np.nan for n, s in enumerate(self._frames, start=1)]
        )

    def known_at(self, t: float) -> Array:
        """Return S_1, S_2, ... [m] as they were known at a time [s], shape (marker_count,)."""
        found = bisect_right(self._stamps, t)
        if found == 0:
            return np.full(self._condition.marker_count, np.nan)
        return self._known[found - 1]

    def _with_frames(self, frames: int) -> frozenset[int]:
        return frozenset(n for n, s in enumerate(self._frames, start=1) if len(s) >= frames)
