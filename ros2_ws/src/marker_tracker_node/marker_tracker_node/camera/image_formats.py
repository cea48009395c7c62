"""Pixels as a camera delivers them, read into blue, green and red, and written as it does."""

import sys
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.arrays import ByteArray
from winding_core.raw_image import BGR8, ENCODINGS, FileImage, ImageFormatError, RawImage

__all__ = ["ENCODINGS", "FileImage", "ImageFormatError", "PixelReader", "RawImage"]

# Widths of a sensor's numbers that words of 16 bits may hold [bits].
_NARROW = (10, 12, 14)
_WORD_BITS = 16
_PROOF = 8  # So many pictures with narrow values are no coincidence of a dark scene
COMPRESSIONS = ("jpeg", "png")  # Files of a CompressedImage, by what they are called there
# A camera's mosaic stays as it is, and its pictures are not turned.
_AS_IT_IS = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION


@dataclass
class PixelReader:
    """Reads the pictures of one stream."""

    encoding: str = ""  # Takes the place of what the pictures state; empty to use that.
    significant_bits: int = 0  # Bits that count in a word of 16, from the lowest; 0 for all.
    brightest: int = 0  # Largest value in words so far.
    words: int = 0  # Pictures of words so far.

    def frame(self, image: RawImage | FileImage) -> ByteArray:
        """Return a picture, blue-green-red of 8 bits, shape (height, width, 3).

        It may not be written to: pixels that need no change are not copied.

        Raises:
            ImageFormatError: Its encoding has no colours or is unknown, bytes are missing,
                values have more than the significant bits, or a file holds no picture.
        """
        if isinstance(image, FileImage):
            image = self._decompressed(image)
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

    def decoded(self, picture: NDArray[Any]) -> RawImage:
        """Return numbers that OpenCV has read from a file as a picture that may be read otherwise.

        Args:
            picture: uint8 or uint16, shape (height, width) or, blue-green-red, (height, width, 3).
        """
        if self.encoding.startswith("bayer") and picture.ndim == 3:
            # A video or JPEG holds the mosaic as three equal channels.
            picture = picture[:, :, 0]
        bits = 8 * picture.dtype.itemsize
        return _as_image(picture, f"mono{bits}" if picture.ndim == 2 else f"bgr{bits}")

    def _decompressed(self, image: FileImage) -> RawImage:
        data = np.frombuffer(image.data, dtype=np.uint8)
        try:
            picture = cv2.imdecode(data, _AS_IT_IS)
        except cv2.error:
            picture = None
        if picture is None:
            raise ImageFormatError(
                f"{data.size} bytes of format {image.format[:40]!r} are no picture"
            )
        decoded = self.decoded(np.asarray(picture))
        declared = image.format.partition(";")[0].strip()
        # image_transport writes a mosaic as grey and names its pattern.
        mosaic = picture.ndim == 2 and declared.startswith("bayer")
        return decoded._replace(encoding=declared) if mosaic else decoded

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


def encoded(frame: ByteArray, encoding: str) -> RawImage:
    """Return a frame as a camera of an encoding delivers it, the inverse of `PixelReader.frame`.

    A mosaic keeps of each pixel the colour that its filter lets through, which loses the others.

    Args:
        frame: Blue-green-red of 8 bits, shape (height, width, 3).
        encoding: One of ENCODINGS; words of 16 bits hold the numbers of 8 from 0 to 65535.
    """
    name, words = encoding.rstrip("0123456789"), encoding.endswith("16")
    if name.startswith("bayer"):
        numbers = np.empty(frame.shape[:2], dtype=np.uint8)
        for place, letter in enumerate(name[-4:]):
            row, column = divmod(place, 2)
            numbers[row::2, column::2] = frame[row::2, column::2, "bgr".index(letter)]
    elif name == "bgr":
        numbers = frame
    else:
        numbers = np.asarray(cv2.cvtColor(frame, getattr(cv2, f"COLOR_BGR2{name.upper()}")))
    # 255 becomes 65535, and the upper byte of each word is the number.
    return _as_image(numbers.astype(np.uint16) * np.uint16(257) if words else numbers, encoding)


def compressed(image: RawImage, kind: str) -> FileImage:
    """Return a picture as image_transport compresses it.

    Args:
        image: In one of ENCODINGS.
        kind: One of COMPRESSIONS.

    Raises:
        ImageFormatError: The picture holds no colours, or JPEG is to hold 16 bits.
    """
    numbers = image.numbers()
    target = ""
    if numbers.ndim == 3:
        target = f"bgr{8 * numbers.dtype.itemsize}"
        name = image.encoding.rstrip("0123456789").upper()
        if name != "BGR":
            numbers = np.asarray(cv2.cvtColor(numbers, getattr(cv2, f"COLOR_{name}2BGR")))
    if kind == "jpeg" and numbers.dtype != np.uint8:
        raise ImageFormatError(f"JPEG holds 8 bits, and {image.encoding} has 16: use png")
    _, data = cv2.imencode(f".{kind}", numbers)
    return FileImage(f"{image.encoding}; {kind} compressed {target}", data)


def _as_image(numbers: NDArray[Any], encoding: str) -> RawImage:
    """Return numbers of pixels, row after row, as a picture of an encoding."""
    height, width = numbers.shape[:2]
    data = np.ascontiguousarray(numbers).reshape(-1).view(np.uint8)
    step = data.size // max(height, 1)
    return RawImage(height, width, encoding, step, sys.byteorder == "big", data)
