"""What a machine has said so far in a run, as a file: a model that is started late reads it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from winding_core.machine.readings import AxisReading
from winding_core.parameters import parameter

# t [s], both axes as in AxisReading, tension [N]; nan where no tension had been read yet.
INPUT_DTYPE = np.dtype(
    [
        (name, "<f8")
        for name in (
            "t",
            "cylinder_angle",
            "angular_speed",
            "carriage_position",
            "feed_speed",
            "tension",
        )
    ]
)


@dataclass(frozen=True, kw_only=True)
class ReplayParameters:
    """Of a node that takes up a run in the middle."""

    replay: str = parameter(
        "", "file of a run's inputs so far, written by the orchestrator, to take up the run with"
    )


class RunInputsError(ValueError):
    """A file does not hold the inputs of a run."""


@dataclass(frozen=True, kw_only=True)
class RunInputs:
    """Encoder samples of a run with the tension that was known at each.

    Attributes:
        samples: Shape (n,) of INPUT_DTYPE, ascending in time.
    """

    samples: NDArray[Any]

    def __post_init__(self) -> None:
        times = self.samples["t"]
        if not (np.isfinite(times).all() and (np.diff(times) >= 0.0).all()):
            raise RunInputsError("the times of a run's inputs must ascend")

    def write(self, file: Path) -> None:
        """Write the inputs as a NumPy file."""
        with file.open("wb") as target:
            np.save(target, self.samples, allow_pickle=False)

    @classmethod
    def read(cls, file: Path) -> RunInputs:
        """Return the inputs of a NumPy file.

        Raises:
            FileNotFoundError: There is no such file.
            RunInputsError: It holds something else.
        """
        with file.open("rb") as source:
            try:
                samples = np.load(source, allow_pickle=False)
            except (ValueError, EOFError, OSError, BadZipFile, MemoryError) as error:
                # A head may claim more samples than there is memory.
                raise RunInputsError(f"{file} holds no inputs of a run: {error}") from error
        if not isinstance(samples, np.ndarray) or samples.dtype != INPUT_DTYPE:
            raise RunInputsError(f"{file} holds no inputs of a run")
        return cls(samples=samples)

    def __iter__(self) -> Iterator[tuple[float, AxisReading, float | None]]:
        """Yield (t [s], reading, tension [N] or None)."""
        for sample in self.samples:
            tension = float(sample["tension"])
            yield (
                float(sample["t"]),
                AxisReading(
                    cylinder_angle=float(sample["cylinder_angle"]),
                    angular_speed=float(sample["angular_speed"]),
                    carriage_position=float(sample["carriage_position"]),
                    feed_speed=float(sample["feed_speed"]),
                ),
                None if np.isnan(tension) else tension,
            )
