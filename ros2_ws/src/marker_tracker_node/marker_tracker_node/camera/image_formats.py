"""Pixels as a camera delivers them, whatever their encoding: read into blue, green and red."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.arrays import ByteArray
from winding_core.raw_image import BGR8, ENCODINGS, ImageFormatError, RawImage

__all__ = ["ENCODINGS", "ImageFormatError", "PixelReader", "RawImage"]

# Widths of a sensor's numbers that words of 16 bits may hold [bits].
_NARROW = (10, 12, 14)
_WORD_BITS = 16
# So many pictures with narrow values are no coincidence of a dark scene.
_PROOF = 8


@dataclass
class PixelReader:
    """Reads the pictures of one stream."""

    encoding: str = ""  # Takes the place of what the pictures state; empty to use that.
    significant_bits: int = 0  # Bits that count in a word of 16, from the lowest; 0 for all.
    brightest: int = 0  # Largest value in words so far.
    words: int = 0  # Pictures of words so far.

    def frame(self, image: RawImage) -> ByteArray:
        """Return a picture, blue-green-red of 8 bits, shape (height, width, 3).

        It may not be written to: pixels that need no change are not copied.

        Raises:
            ImageFormatError: Its encoding has no colours or is unknown, bytes are missing, or
                values have more than the significant bits.
        """
        encoding = self.encoding or image.encoding
        numbers = image._replace(encoding=encoding).numbers()
        if encoding == BGR8:
            return numbers
        if not numbers.size:
            return np.empty((image.height, image.width, 3), dtype=np.uint8)
        if numbers.dtype == np.uint8:
            return _colours(numbers, encoding)
        shift = self._beyond_eight(numbers)
        return (_colours(numbers, encoding) >> shift).astype(np.uint8)

    @property
    def remark(self) -> str:
        """What the values show against the significant bits; empty if nothing."""
        if self.words < _PROOF or self.significant_bits or not self.brightest:
            return ""
        for bits in _NARROW:
            if self.brightest < 1 << bits:
                return (
                    f"no value in {self.words} pictures of 16 bits is above {self.brightest}: "
                    f"set significant_bits to {bits} if the camera has so many"
                )
        return ""

    def _beyond_eight(self, numbers: NDArray[np.uint16]) -> int:
        bits, most = self.significant_bits or _WORD_BITS, int(numbers.max())
        self.words += 1
        self.brightest = max(self.brightest, most)
        if most >= 1 << bits:
            raise ImageFormatError(
                f"significant_bits is {bits}, values up to {(1 << bits) - 1}, "
                f"but a pixel has {most}"
            )
        return bits - 8


def _colours(numbers: NDArray[Any], encoding: str) -> NDArray[Any]:
    name = encoding.rstrip("0123456789").upper()
    if name == "BGR":
        return numbers
    if name.startswith("BAYER"):
        if min(numbers.shape) < 3:
            height, width = numbers.shape
            raise ImageFormatError(f"a mosaic needs 3 x 3 pixels, got {width} x {height}")
        name = name.replace("BAYER_", "Bayer")
    return np.asarray(cv2.cvtColor(numbers, getattr(cv2, f"COLOR_{name}2BGR")))
