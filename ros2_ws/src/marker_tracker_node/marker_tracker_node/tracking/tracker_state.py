"""How the kernels' numbers cross from Python and back: as few plain arrays.

Numba looks at every field of a nested tuple anew with each call, which takes longer than a frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import CameraView
from marker_tracker_node.detection.band import Body
from marker_tracker_node.tracking.state import (
    BY_READINGS,
    CANDIDATES,
    PATH_SIZE,
    Candidates,
    Cylinder,
    FlagArray,
    Guide,
    IndexArray,
    Marks,
    Output,
    Run,
    Setup,
    Tracks,
)
from winding_core.compiling import called

FloatArray = NDArray[np.float64]

_CYLINDER, _GUIDE = len(Cylinder._fields), len(Guide._fields)
RUN_SIZE = _CYLINDER + _GUIDE + len(Run._fields) - 2
_BELIEF, _SHIFT = _CYLINDER + Guide._fields.index("belief"), _CYLINDER + _GUIDE
# Fields of `Output` that have a number for every frame and marker.
OUTPUT_FIELDS = tuple(name for name in Output._fields if name not in ("angle", "flags"))


@dataclass(kw_only=True)
class TrackerState:
    """The one mutable state of a tracker.

    Attributes:
        numbers: Of `run`, shape (RUN_SIZE,).
        known: Of `Marks`, shape (markers,).
        marks: Its other fields, shape (8, markers).
        hits: Of `Candidates`, and their colours, shape (2, CANDIDATES).
        candidates: Its other fields, shape (6, CANDIDATES).
        paths: See `Tracks` [m], shape (2, PATH_SIZE).
    """

    numbers: FloatArray
    known: FlagArray
    marks: FloatArray
    hits: IndexArray
    candidates: FloatArray
    paths: FloatArray

    @classmethod
    def fresh(cls, marker_count: int) -> TrackerState:
        """Return the state before the first frame."""
        markers = marker_count + 1
        state = cls(
            numbers=np.zeros(RUN_SIZE),
            known=np.zeros(markers, dtype=np.bool_),
            marks=np.zeros((len(Marks._fields) - 1, markers)),
            hits=np.zeros((2, CANDIDATES), dtype=np.int64),
            candidates=np.zeros((len(Candidates._fields) - 2, CANDIDATES)),
            paths=np.zeros((2, PATH_SIZE)),
        )
        state.run = Run(
            cylinder=Cylinder(0.0, 0.0, 0.0, 0.0, False, False, math.nan),
            guide=Guide(0.0, math.nan, math.nan, 0.0, 0.0, 0.0, BY_READINGS, 0.0),
            shift=0.0,
            shift_weight=0.0,
            path_filled=1,
        )
        return state

    @property
    def run(self) -> Run:
        """What all markers have in common."""
        return run_of(self.numbers)

    @run.setter
    def run(self, run: Run) -> None:
        write_run(run, self.numbers)

    @property
    def shift(self) -> float:
        """See `Run` [rad]."""
        return float(self.numbers[_SHIFT])

    @property
    def path(self) -> FloatArray:
        """That of `Tracks.paths` that is believed, shape (PATH_SIZE,)."""
        path: FloatArray = self.paths[0 if self.numbers[_BELIEF] == BY_READINGS else 1]
        return path

    @property
    def tracks(self) -> Tracks:
        """What is known of each marker, as views."""
        return tracks_of(self.known, self.marks, self.hits, self.candidates, self.paths)


@dataclass(frozen=True, kw_only=True)
class OutputRoom:
    """Arrays that an `Output` is made of.

    Attributes:
        angle: See `Output` [rad], shape (frames,).
        flags: See `Output`, shape (frames, markers).
        fields: The others, in their order, shape (fields, frames, markers).
    """

    angle: FloatArray
    flags: NDArray[np.uint32]
    fields: FloatArray

    @classmethod
    def empty(cls, frames: int, markers: int) -> OutputRoom:
        """Return room for a number of frames, nan everywhere and without flags."""
        return cls(
            angle=np.full(frames, math.nan),
            flags=np.zeros((frames, markers), dtype=np.uint32),
            fields=np.full((len(OUTPUT_FIELDS), frames, markers), math.nan),
        )

    @property
    def output(self) -> Output:
        """The fields by their names, as views."""
        return output_of(self.angle, self.flags, self.fields)


def setup_numbers(setup: Setup) -> FloatArray:
    """Return the numbers of a setup, which `setup_of` makes it of again."""
    return np.array([*setup.camera, *setup.body, *setup[2:]])


@called
def setup_of(n: FloatArray) -> Setup:  # pragma: no cover
    """Return the setup that `setup_numbers` has taken apart."""
    camera = CameraView(
        n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], n[8], n[9], n[10], n[11], n[12], n[13],
        n[14], n[15], n[16], n[17], n[18], n[19], n[20], n[21], n[22], n[23],
    )  # fmt: skip
    body = Body(n[24], n[25], n[26], n[27])
    return Setup(
        camera, body, n[28], n[29], n[30], n[31], n[32], n[33], n[34], n[35], n[36], n[37],
    )  # fmt: skip


@called
def run_of(n: FloatArray) -> Run:  # pragma: no cover
    """Return the run that `write_run` has taken apart."""
    return Run(
        Cylinder(n[0], n[1], n[2], n[3], n[4] != 0.0, n[5] != 0.0, n[6]),
        Guide(n[7], n[8], n[9], n[10], n[11], n[12], int(n[13]), n[14]),
        n[15],
        n[16],
        int(n[17]),
    )


@called
def write_run(run: Run, n: FloatArray) -> None:  # pragma: no cover
    """Write the numbers of a run, shape (RUN_SIZE,)."""
    c, g = run.cylinder, run.guide
    n[0], n[1], n[2], n[3], n[4], n[5], n[6] = (
        c.angle, c.time, c.rate, c.wraps, c.started, c.blind, c.read,
    )  # fmt: skip
    n[7], n[8], n[9], n[10], n[11], n[12], n[13], n[14] = (
        g.way, g.reading, g.zero, g.travel, g.turned, g.offset, g.belief, g.since,
    )  # fmt: skip
    n[15], n[16], n[17] = run.shift, run.shift_weight, run.path_filled


@called
def tracks_of(
    known: FlagArray, m: FloatArray, hits: IndexArray, c: FloatArray, paths: FloatArray
) -> Tracks:  # pragma: no cover
    """Return the arrays of a `TrackerState` by their names.

    Args:
        known: See `TrackerState`, shape (markers,).
        m: Its marks, shape (8, markers).
        hits: See `TrackerState`, shape (CANDIDATES,).
        c: Its candidates, shape (6, CANDIDATES).
        paths: See `Tracks` [m], shape (2, PATH_SIZE).
    """
    return Tracks(
        Marks(known, m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7]),
        Candidates(hits[0], hits[1], c[0], c[1], c[2], c[3], c[4], c[5]),
        paths,
    )


@called
def output_of(
    angle: FloatArray, flags: NDArray[np.uint32], f: FloatArray
) -> Output:  # pragma: no cover
    """Return the arrays of an `OutputRoom` by their names.

    Args:
        angle: See `OutputRoom` [rad], shape (frames,).
        flags: See `OutputRoom`, shape (frames, markers).
        f: Its fields, shape (fields, frames, markers).
    """
    return Output(
        angle, f[0], f[1], f[2], f[3], flags, f[4], f[5], f[6], f[7], f[8], f[9], f[10],
        f[11], f[12],
    )  # fmt: skip
