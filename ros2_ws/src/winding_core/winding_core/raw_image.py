"""A picture as a camera delivers it, and the encodings that hold colours (REP-118)."""

import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

BGR8 = "bgr8"
# Numbers of a pixel and bytes of a number.
ENCODINGS = {
    f"{name}{8 * size}": (numbers, size)
    for names, numbers in (
        (("bgr", "rgb"), 3),
        (("bgra", "rgba"), 4),
        (("bayer_rggb", "bayer_bggr", "bayer_gbrg", "bayer_grbg"), 1),
    )
    for size in (1, 2)
    for name in names
}


class ImageFormatError(ValueError):
    """A picture cannot be read: one sentence with what it is and what is needed."""


class FileImage(NamedTuple):
    """A picture as the bytes of a file, which a CompressedImage holds."""

    format: str  # As the message states it, such as "bayer_rggb8; png compressed ".
    data: bytes | memoryview | NDArray[np.uint8]  # The file.


class RawImage(NamedTuple):
    """A picture as it came."""

    height: int  # Rows.
    width: int  # Columns.
    encoding: str  # As sensor_msgs/image_encodings.hpp names it.
    step: int  # From row to row [bytes].
    big_endian: bool  # Order of the bytes of a word.
    data: bytes | memoryview | NDArray[np.uint8]  # The rows, `step` bytes each.

    def numbers(self) -> NDArray[Any]:
        """Return its numbers, uint8 or uint16, shape (height, width) or (height, width, numbers).

        It may not be written to: numbers of 8 bits are not copied.

        Raises:
            ImageFormatError: Its encoding has no colours or is unknown, or bytes are missing.
        """
        if self.encoding not in ENCODINGS:
            raise ImageFormatError(_refusal(self.encoding))
        numbers, size = ENCODINGS[self.encoding]
        data = np.frombuffer(self.data, dtype=np.uint8)
        least = numbers * size * self.width
        if self.step < least or data.size != self.step * self.height:
            raise ImageFormatError(
                f"image of {self.width} x {self.height} in {self.encoding} with step {self.step} "
                f"needs {max(self.step, least) * self.height} bytes, got {data.size}"
            )
        rows: NDArray[Any] = data.reshape(self.height, self.step)[:, :least]
        if size == 2:
            if self.step % 2:
                raise ImageFormatError(f"step must be even in words of 16 bits, got {self.step}")
            rows = rows.view(">u2" if self.big_endian else "<u2").astype(np.uint16, copy=False)
        return rows.reshape(self.height, self.width, *((numbers,) if numbers > 1 else ()))


def _refusal(encoding: str) -> str:
    if re.fullmatch(r"mono\d+|\d+[US]C1", encoding):
        return (
            f"image encoding {encoding!r} holds no colour, which identifies the markers; if the "
            "sensor has a colour filter, set encoding to its bayer pattern"
        )
    return f"image encoding must be one of {', '.join(ENCODINGS)}, got {encoding!r}"
