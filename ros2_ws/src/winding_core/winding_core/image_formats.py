"""Pixels as a camera delivers them, whatever their encoding: read into blue, green and red."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

ByteArray = NDArray[np.uint8]

BGR8 = "bgr8"
# Places of blue, green and red among a pixel's numbers and how many those are; their bytes.
_COLOURS = {
    f"{name}{bits}": (
        (name.index("b"), name.index("g"), name.index("r"), len(name)),
        bits // 8,
    )
    for bits in (8, 16)
    for name in ("bgr", "rgb", "bgra", "rgba")
}
# Row and column of the first red pixel, and bytes of a pixel.
_MOSAICS = {
    f"bayer_{name}{bits}": (*divmod(name.index("r"), 2), bits // 8)
    for bits in (8, 16)
    for name in ("rggb", "bggr", "gbrg", "grbg")
}
ENCODINGS = (*_COLOURS, *_MOSAICS)
# Words that hold ten or twelve bits are told by their largest value.
_NARROW = (10, 12, 14)
_WORD_BITS = 16
# So many pictures with narrow values are no coincidence of a dark scene.
_PROOF = 8


class ImageFormatError(ValueError):
    """A picture cannot be read: one sentence says what it is and what is needed."""


class RawImage(NamedTuple):
    """A picture as it came.

    Attributes:
        height: Rows.
        width: Columns.
        encoding: As sensor_msgs/image_encodings.hpp names it.
        step: From row to row [bytes].
        big_endian: Order of the bytes of a word.
        data: The rows, at least `step` bytes each.
    """

    height: int
    width: int
    encoding: str
    step: int
    big_endian: bool
    data: bytes | memoryview | ByteArray


@dataclass
class PixelReader:
    """Reads the pictures of one stream.

    Attributes:
        encoding: What the pixels are, whatever the pictures say; empty to believe those.
        significant_bits: Bits that count in a word of 16, from the lowest; 0 for all.
        brightest: Largest value in words so far.
        words: Pictures of words so far.
    """

    encoding: str = ""
    significant_bits: int = 0
    brightest: int = 0
    words: int = 0

    def frame(self, image: RawImage) -> ByteArray:
        """Return a picture, blue-green-red of 8 bits, shape (height, width, 3).

        It may not be written to: pixels that need no change are not copied.

        Raises:
            ImageFormatError: Its encoding has no colours or is unknown, bytes are missing, or
                values have more than the significant bits.
        """
        encoding = self.encoding or image.encoding
        numbers, size = _layout(encoding)
        height, width, _, step, _, buffer = image
        data = np.frombuffer(buffer, dtype=np.uint8)
        least = numbers * size * width
        if step < least or data.size != step * height:
            raise ImageFormatError(
                f"image of {width} x {height} in {encoding} with step {step} needs "
                f"{max(step, least) * height} bytes, got {data.size}"
            )
        if encoding == BGR8:
            return data.reshape(height, step)[:, :least].reshape(height, width, 3)
        out = np.empty((height, width, 3), dtype=np.uint8)
        if not out.size:
            return out
        # Options and parameters name the encodings, and need no compiler for that.
        from winding_core.pixel_kernels import demosaic, largest, unpack  # noqa: PLC0415

        rows: NDArray[np.uint8] | NDArray[np.uint16] = data.reshape(height, step)
        swapped, shift = False, 0
        if size == 2:
            rows = _words(data.reshape(height, step))
            swapped = image.big_endian is (sys.byteorder == "little")
            bits = self.significant_bits or _WORD_BITS
            self._judge(largest(rows, numbers * width, swapped), bits)
            shift = bits - 8
        if encoding in _COLOURS:
            unpack(rows, _COLOURS[encoding][0], swapped, shift, out)
        elif min(height, width) < 2:
            raise ImageFormatError(f"a mosaic needs 2 x 2 pixels, got {width} x {height}")
        else:
            demosaic(rows, _MOSAICS[encoding][:2], swapped, shift, out)
        return out

    @property
    def remark(self) -> str:
        """What the values say against the significant bits; empty if nothing."""
        if self.words < _PROOF or self.significant_bits or not self.brightest:
            return ""
        for bits in _NARROW:
            if self.brightest < 1 << bits:
                return (
                    f"no value in {self.words} pictures of 16 bits is above {self.brightest}: "
                    f"set significant_bits to {bits} if the camera has so many"
                )
        return ""

    def _judge(self, most: int, bits: int) -> None:
        self.words += 1
        self.brightest = max(self.brightest, most)
        if most >= 1 << bits:
            raise ImageFormatError(
                f"significant_bits is {bits}, values up to {(1 << bits) - 1}, "
                f"but a pixel has {most}"
            )


def warm_up() -> None:
    """Compile what reads pixels, ahead of the first picture."""
    for encoding in ("rgb8", "rgb16", "bayer_rggb8", "bayer_rggb16"):
        numbers, size = _layout(encoding)
        step = 2 * numbers * size
        PixelReader().frame(RawImage(2, 2, encoding, step, False, bytes(2 * step)))


def _words(rows: ByteArray) -> NDArray[np.uint16]:
    if rows.shape[1] % 2:
        raise ImageFormatError(f"step must be even in words of 16 bits, got {rows.shape[1]}")
    return rows.view(np.uint16)


def _layout(encoding: str) -> tuple[int, int]:
    """Return the numbers of a pixel and the bytes of a number."""
    if encoding in _COLOURS:
        places, size = _COLOURS[encoding]
        return places[3], size
    if encoding in _MOSAICS:
        return 1, _MOSAICS[encoding][2]
    if re.fullmatch(r"mono\d+|\d+[US]C1", encoding):
        raise ImageFormatError(
            f"image encoding {encoding!r} holds no colour, and markers are told by theirs; if the "
            "sensor has a colour filter, set encoding to its bayer pattern"
        )
    raise ImageFormatError(
        f"image encoding must be one of {', '.join(ENCODINGS)}, got {encoding!r}"
    )
