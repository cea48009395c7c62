"""How a camera's pixels are to be read, stated once for the tracker and the command `track`."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.parameters import parameter
from winding_core.raw_image import ENCODINGS
from winding_core.units import PLAIN, ROW_TIME


@dataclass(frozen=True, kw_only=True)
class CameraPixels:
    """What the stream does not say of its pixels, or says wrongly."""

    encoding: str = parameter(
        "", "how the pixels are encoded, whatever the pictures say", PLAIN,
        choices=("", *ENCODINGS),
    )  # fmt: skip
    significant_bits: int = parameter(
        0, "bits that count in words of 16 bits, from the lowest", PLAIN, 8, 16, otherwise="16"
    )
    row_time: float = parameter(
        0.0,
        "time from a row of the picture to the next of a rolling shutter, negative where the "
        "lowest row is read first; the stamp is that of the row read first",
        ROW_TIME,
        -0.001,
        0.001,
    )
