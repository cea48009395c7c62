"""Progress of a run for a log file."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from winding_recorder.live.recorder import RunBuffer


def print_sentence(sentence: str) -> None:
    """Print a sentence at once."""
    print(sentence, flush=True)


class ProgressLines:
    """Progress for a log file: a line for every tenth of the run."""

    def __init__(self, duration: float, first_words: str) -> None:
        self._duration = duration
        self._printed = 0
        print(first_words, file=sys.stderr, flush=True)

    def __call__(self, buffer: RunBuffer, wall: float) -> None:
        """Print how far a run has come after a wall time [s], if that is a tenth further."""
        t = buffer.time
        tenth = int(10.0 * t / self._duration)
        if tenth > self._printed:
            self._printed = tenth
            print(
                f"{t:6.2f} of {self._duration:.2f} s simulated, {wall:.1f} s on the clock",
                file=sys.stderr,
                flush=True,
            )
