"""What is known of the run: the newest of everything, and the last minute of what moves.

A reader decodes messages and calls the `note_*` methods with times of the machine's clock;
`tick` then makes one sample of the charts. Everything is bounded.
"""

import math
import textwrap
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.material_report import MaterialReport
from winding_core.cable.wound_label import WoundLabel
from winding_core.lay.records import LAY_DTYPE, LayRecords
from winding_core.machine.readings import CABLE_TENSION, AxisReading, Quantity
from winding_core.markers import CABLE_DTYPE, CORRECTED_DTYPE, MARKER_DTYPE, Markers
from winding_core.status import OUTCOME_COMPONENT, PLAYBACK, STATUS, RunPhase, Status
from winding_dashboard.state.camera_view import CameraView
from winding_dashboard.state.control_state import ControlState
from winding_dashboard.state.health import RECORDER, SILENCE, Health
from winding_dashboard.state.marker_rows import MOST_MARKERS, NAN, MarkerRow, marker_rows

# The machine's clock went back by more: a new run, or a recording from its beginning [s].
_NEW_RUN = 0.5
# Pictures and markers further apart do not belong together [s].
TOGETHER = 0.5
_DEFAULT_CABLE_RADIUS = 0.002
# Ten samples a second for a minute.
SAMPLES = 600
STANDING = 0.01
_OLD = 1.0  # On the machine's clock an older value is no longer the present one [s]
# Wall time without a new time of the machine after which its clock stands, or is not heard [s].
_STANDS = 0.5
# Characters of a message that are shown as text.
_OTHER_LENGTH = 160
_OUTCOME = f"orchestrator: {OUTCOME_COMPONENT}"
LENGTHS = ("predicted", "corrected", "low", "high", "measured")
Trace = deque[tuple[float, Mapping[str, float]]]  # Times [s] with what was then
# Attributes that nodes publish while the machine's clock runs.
SOURCES = ("tracked", "predicted", "corrected", "cable", "lay", "picture")


@dataclass(eq=False, kw_only=True)
class ViewState:
    """Everything the page shows."""

    nodes: Sequence[str]  # Names of the graph's nodes, in the order in which they are shown
    machine: str  # Name of the node whose own message is the machine's phase
    solver: str  # Name of the node that reports what is wound
    # What the machine's sensors measure, the tension among it
    quantities: Sequence[Quantity] = (CABLE_TENSION,)

    def __post_init__(self) -> None:
        self.health = Health(self.nodes)
        self.control = ControlState()
        # Measured and commanded motion, and the curve lengths of each marker by its number.
        self.speeds: Trace = deque(maxlen=SAMPLES)
        self.lengths: dict[int, Trace] = {
            number: deque(maxlen=SAMPLES) for number in range(1, MOST_MARKERS + 1)
        }
        self.cable_radius = _DEFAULT_CABLE_RADIUS
        self.camera: CameraView | None = None
        self.last_data = float("-inf")
        self.resets = 0  # How often the run was forgotten, so that time may begin again
        self.player = ""  # Node that plays a recording in the machine's place
        self.outcome: Mapping[str, str] = {}  # Record of the run that is over
        self.clear()

    def begin_anew(self) -> None:
        """Forget the run and what was wound: the nodes are built for another."""
        self.clear()
        self.health.forget(self.solver)

    def clear(self) -> None:
        """Forget the run; health and camera stay."""
        self.resets += 1
        # The orchestrator repeats the outcome of a run until the next one has begun.
        self._forgotten, self.outcome = self.health.values(_OUTCOME), {}
        self.clock_stands = False  # Or it is not heard any more
        self.time = self._standing_until = NAN  # Newest of the machine's clock [s]
        self._first_motion: tuple[float, float, float] | None = None
        self.axes: AxisReading | None = None
        self.setpoints: AxisReading | None = None
        self.measured = dict.fromkeys(self.quantities, NAN)  # In SI units
        self.others: dict[str, str] = {}  # Topics without a part of the page, as text
        self.picture = b""  # The newest preview, JPEG
        self.votes: dict[int, float] = {}  # Share by case number, best first
        self.material: MaterialReport | None = None
        self.tracked: Markers = np.zeros(0, MARKER_DTYPE)
        self.predicted: Markers = np.zeros(0, MARKER_DTYPE)
        self.ahead: Markers = np.zeros(0, MARKER_DTYPE)
        self.corrected: Markers = np.zeros(0, CORRECTED_DTYPE)
        self.cable: NDArray[np.void] = np.zeros(0, CABLE_DTYPE)
        self.lay: LayRecords = np.zeros(0, LAY_DTYPE)  # Measured
        self.advance = NAN  # Of the commanded helix [m/rad]
        self.times = dict.fromkeys(SOURCES, NAN)  # Newest of each source and sensor [s]
        self.control.clear()
        self.speeds.clear()
        for trace in self.lengths.values():
            trace.clear()

    @property
    def run_began(self) -> float:
        """When the cylinder began to turn, or the present while it stands [s]; nan before any.

        A page that joins later takes it from angle and speed: the axes ramp linearly, then hold.
        """
        if self._first_motion is None or not math.isnan(self._standing_until):
            return self._standing_until
        t, angle, speed = self._first_motion
        way = max(angle / speed, 0.0)
        label = self.label
        ramp = 0.0 if label is None else label.ramp_time
        return t - min(2.0 * way, way + 0.5 * ramp)

    @property
    def run_time(self) -> float:
        """How long the run has gone on, on the machine's clock [s]: 0 before; nan without it."""
        return max(self.time - self.run_began, 0.0)

    @property
    def phase(self) -> str:
        """Phase that the machine reports; empty when it is not heard."""
        phase = self.health.values(self.machine).get("phase", "")
        return phase or self.health.message(self.machine)

    @property
    def run_phase(self) -> RunPhase | None:
        """How far the run is, as the orchestrator reports it; None where it does not."""
        reported = self.health.values(STATUS).get("phase")
        return next((phase for phase in RunPhase if phase.value == reported), None)

    @property
    def going(self) -> bool:
        """Whether the machine reports that it winds, or is about to come to rest."""
        return self.phase in ("winding", "stopping") and self.run_phase is not RunPhase.FAILED

    @property
    def reason(self) -> str:
        """Why the machine is in its phase, in its own words; empty when it reports none."""
        return self.health.values(self.machine).get("reason", "")

    @property
    def label(self) -> WoundLabel | None:
        """What is wound, as the solver reports it; None before, and while it is taken down."""
        if not self.health.works(self.solver):
            return None
        return WoundLabel.from_values(self.health.values(self.solver))

    @property
    def moving(self) -> bool:
        """Whether an axis turns, by the encoders."""
        return self.axes is not None and abs(self.axes.angular_speed) > STANDING

    @property
    def centreline_radius(self) -> float:
        """R + r [m]; nan before any marker cloud."""
        for markers in (self.predicted, self.tracked, self.ahead):
            radii = markers["r"][np.isfinite(markers["r"]) & (markers["r"] > 0.0)]
            if radii.size:
                return float(radii[0])
        return NAN

    def recording(self, now: float) -> Mapping[str, str]:
        """Return what the recorder reports at wall time now [s]; empty when nothing is recorded.

        A session that failed has ended its nodes, and what a player repeats is of another day.
        """
        silent = self.health.silent_for(RECORDER, now) > SILENCE
        over = self.run_phase is RunPhase.FAILED or bool(self.player)
        return {} if silent or over else self.health.values(RECORDER)

    @property
    def playback(self) -> dict[str, float] | None:
        """Position and length of the recording that is played [s], and whether it is paused.

        None where no player reports them.
        """
        try:
            values = self.health.values(PLAYBACK) if self.player else {}
            return {name: float(values[name]) for name in ("position", "length", "paused")}
        except (KeyError, ValueError):
            return None

    def heard(self, now: float) -> bool:
        """Return whether anything came lately, at wall time now [s]."""
        return now - max(self.last_data, self.health.last_heard) <= SILENCE

    def note_statuses(self, now: float, statuses: Sequence[Status]) -> None:
        """Take the statuses of nodes, received at wall time now [s]."""
        self.health.note(now, statuses)
        self.control.note_statuses(statuses)
        values = self.health.values(_OUTCOME)
        if values != self._forgotten:
            self._forgotten, self.outcome = {}, values

    def note_axes(self, t: float, reading: AxisReading) -> None:
        """Take measured motion; time that goes back begins a new run."""
        if t < self.time - _NEW_RUN:
            ahead = self.ahead
            self.clear()
            # Latched: it was sent once, before the run that begins now.
            self.ahead = ahead
        if self._first_motion is None:
            if abs(reading.angular_speed) > STANDING:
                self._first_motion = (t, reading.cylinder_angle, reading.angular_speed)
            else:
                self._standing_until = t
        self.time = t
        self.axes = reading

    def note_source(self, name: str, t: float, content: object) -> None:
        """Take the newest content of an attribute such as one of SOURCES, of time t [s]."""
        self.times[name] = t
        setattr(self, name, content)

    def note_measured(self, quantity: Quantity, t: float, value: float) -> None:
        """Take a sensor's value at time t [s], in SI units."""
        self.measured[quantity] = value
        self.times[quantity.name] = t

    def note_other(self, name: str, content: object) -> None:
        """Take what a topic holds that no part of the page shows."""
        self.others[name] = textwrap.shorten(str(content), _OTHER_LENGTH, placeholder=" ...")

    def old(self, name: str) -> float:
        """Return how old a source's newest message is on the machine's clock [s]; 0 if present.

        The clock of a machine that stands still stands too: what lies is not old.
        """
        behind = self.time - self.times.get(name, NAN)
        return behind if behind > _OLD else 0.0

    def note_votes(self, votes: Mapping[int, float]) -> None:
        """Take the shares of votes by case number."""
        self.votes = dict(sorted(votes.items(), key=lambda item: (-item[1], item[0])))

    def tick(self, now: float) -> None:
        """Add one sample to every chart if the machine's clock went on; now is wall time [s]."""
        if math.isnan(self.time) or (self.speeds and self.time <= self.speeds[-1][0]):
            self.clock_stands = now - self.last_data > _STANDS
            return
        self.last_data, self.clock_stands = now, False
        axes, wanted = self.axes, self.setpoints
        if wanted is not None and abs(wanted.angular_speed) > STANDING:
            self.advance = wanted.feed_speed / wanted.angular_speed
        sample = {
            "speed": axes.angular_speed if axes else NAN,
            "speed_set": wanted.angular_speed if wanted else NAN,
            "feed": axes.feed_speed if axes else NAN,
            "feed_set": wanted.feed_speed if wanted else NAN,
            "tension": self.measured[CABLE_TENSION],
        }
        self.speeds.append((self.time, sample))
        for row in self.marker_rows():
            lengths = {name: getattr(row, name) for name in LENGTHS}
            if any(map(math.isfinite, lengths.values())):
                self.lengths[row.id].append((self.time, lengths))

    def marker_rows(self) -> list[MarkerRow]:
        """Return the table of markers."""
        return marker_rows(
            ahead=self.ahead,
            predicted=self.predicted,
            corrected=self.corrected,
            tracked=self.tracked,
        )

    def newest_marker(self) -> int:
        """Return the last marker with a curve length of its own, or 1."""
        return max((number for number, trace in self.lengths.items() if len(trace)), default=1)

    @property
    def drum_angle(self) -> float:
        """Theta [rad] at the time of the predicted cable; nan before any motion."""
        if self.axes is None:
            return NAN
        return self.axes.cylinder_angle + self.turned(self.time, self._instant)

    @property
    def marker_turn(self) -> float:
        """How far the cylinder turned from the tracked markers to the predicted cable [rad]."""
        return self.turned(self.times["tracked"], self._instant)

    @property
    def _instant(self) -> float:
        return self.time if math.isnan(self.times["cable"]) else self.times["cable"]

    def turned(self, start: float, end: float) -> float:
        """Return how far the cylinder turned between two moments [s] of one view, in rad."""
        apart = end - start
        # Sources further apart than this are not two views of one moment.
        if self.axes is None or not abs(apart) <= TOGETHER:
            return 0.0
        return apart * self.axes.angular_speed
