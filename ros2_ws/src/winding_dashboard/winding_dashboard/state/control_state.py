"""What the controller of the lay reports and its wanted line, as the page keeps them."""

import json
import math
from collections import deque
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from winding_core.lay.errors import WantedLine
from winding_core.lay.records import ControlBasis, ControlMode, LayControlRecords
from winding_core.status import Status
from winding_dashboard.state.health import node_of

Array = NDArray[np.float64]

LAY_CONTROL = "lay_control"
NAN = float("nan")
# Of the wanted line so many samples are kept, so far apart [rad]: a hundred turns.
_SAMPLES, _STEP = 6300, 0.1
_SILENT = 1.0  # The machine's time went on for so long without a word from the controller [s]


class ControlState:
    """Everything the page knows of the controller.

    Attributes:
        newest: Its last record, of LAY_CONTROL_DTYPE; None before any.
        time: Of that [s]; nan before any.
        mode: What it does; None before it is known.
        values: Of its last status, by name.
    """

    def __init__(self) -> None:
        self.mode: ControlMode | None = None
        self.clear()

    def clear(self) -> None:
        """Forget the run; the mode stays as it was switched."""
        self.newest: np.void | None = None
        self.values: Mapping[str, str] = {}
        self.time = NAN
        self._wanted: deque[tuple[float, float]] = deque(maxlen=_SAMPLES)
        self._line: WantedLine | None = None

    @property
    def known(self) -> bool:
        """Whether a controller was ever heard."""
        return self.mode is not None

    def silent(self, now: float) -> bool:
        """Return whether the machine's time now [s] went on without it."""
        return self.newest is not None and now - self.time > _SILENT

    def note(self, t: float, records: LayControlRecords) -> None:
        """Take its record of time t [s]."""
        if not len(records):
            return
        newest = records[-1]
        self.newest, self.time = newest, t
        if int(newest["mode"]) in set(ControlMode):
            self.mode = ControlMode(int(newest["mode"]))
        theta, z = float(newest["theta"]), float(newest["wanted_z"])
        if math.isfinite(theta) and math.isfinite(z):
            if self._wanted and abs(theta - self._wanted[-1][0]) < _STEP:
                return
            self._wanted.append((theta, z))
            self._line = None

    def note_statuses(self, statuses: Sequence[Status]) -> None:
        """Take its mode from /diagnostics: a machine that stands has no new records."""
        for status in statuses:
            if node_of(status.name) == LAY_CONTROL and ":" not in status.name:
                self.values = status.values
                name = status.values.get("mode", "").upper()
                self.mode = ControlMode.__members__.get(name, self.mode)

    @property
    def wanted(self) -> WantedLine:
        """The wanted line as far as it was heard, up to the present."""
        if self._line is None:
            self._line = WantedLine.of(*np.array(self._wanted).reshape(-1, 2).T)
        return self._line

    @property
    def layer_turns(self) -> list[float]:
        """Turns behind P0 at which each layer of a drum begins and the last ends; else none."""
        return [float(turn) for turn in json.loads(self.values.get("layer_turns", "[]"))]

    @property
    def faults(self) -> Array:
        """Wound angles of gaps, climbs and missing edge turns that were found last [rad], (n,)."""
        found = json.loads(self.values.get("layer_faults", "[]"))
        return np.array([fault["theta"] for fault in found], dtype=float)

    @property
    def basis(self) -> ControlBasis | None:
        """What its commands rest on; None before any."""
        number = -1 if self.newest is None else int(self.newest["basis"])
        return ControlBasis(number) if number in set(ControlBasis) else None
