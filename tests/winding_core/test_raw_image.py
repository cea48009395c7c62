"""Every encoding of a camera comes out as the same blue, green and red."""

import numpy as np
import pytest

from marker_tracker_node.camera.image_formats import (
    ENCODINGS,
    ImageFormatError,
    PixelReader,
    RawImage,
)

ROWS, COLUMNS = 12, 18


def colours() -> np.ndarray:
    """A picture whose channels are planes over the picture: interpolation gives them exactly."""
    v, u = np.mgrid[:ROWS, :COLUMNS]
    planes = (4 * u + 2 * v, 200 - 4 * u - 4 * v, 20 + 8 * v)
    return np.stack(planes, axis=-1).astype(np.uint16)


def raw(encoding: str, *, bits: int = 8, big: bool = False, padding: int = 0) -> RawImage:
    picture = colours() << (bits - 8)
    if encoding.startswith("bayer"):
        numbers = np.empty((ROWS, COLUMNS), np.uint16)
        for place, name in enumerate(encoding[6:10]):
            row, column = divmod(place, 2)
            numbers[row::2, column::2] = picture[row::2, column::2, "bgr".index(name)]
    else:
        names = encoding.rstrip("0123456789")
        planes = [picture[..., "bgr".index(n)] if n != "a" else picture[..., 0] for n in names]
        numbers = np.stack(planes, axis=-1)
    words = numbers.astype((">u2" if big else "<u2") if encoding.endswith("16") else np.uint8)
    rows = words.reshape(ROWS, -1).view(np.uint8).reshape(ROWS, -1)
    padded = np.full((ROWS, rows.shape[1] + padding), 77, np.uint8)
    padded[:, : rows.shape[1]] = rows
    return RawImage(ROWS, COLUMNS, encoding, padded.shape[1], big, padded.tobytes())


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("padding", [0, 14])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_every_encoding_gives_the_same_colours(encoding: str, padding: int, big: bool) -> None:
    bits = 16 if encoding.endswith("16") else 8
    frame = PixelReader().frame(raw(encoding, bits=bits, big=big, padding=padding))
    assert frame.shape == (ROWS, COLUMNS, 3)
    # At the edges the mirror bends the planes.
    inner = (slice(1, -1), slice(1, -1)) if encoding.startswith("bayer") else (slice(None),) * 2
    np.testing.assert_array_equal(frame[inner], colours()[inner])


@pytest.mark.parametrize("bits", [10, 12, 14])
@pytest.mark.parametrize("encoding", ["bgr16", "bayer_gbrg16"])
def test_few_bits_in_wide_words_are_scaled_as_configured(encoding: str, bits: int) -> None:
    frame = PixelReader(significant_bits=bits).frame(raw(encoding, bits=bits))
    np.testing.assert_array_equal(frame[1:-1, 1:-1], colours()[1:-1, 1:-1])


@pytest.mark.parametrize(("bits", "most"), [(10, 800), (12, 3200)])
def test_few_bits_in_wide_words_are_noticed(bits: int, most: int) -> None:
    reader = PixelReader()
    for _ in range(8):
        reader.frame(raw("rgb16", bits=bits))
    assert f"is above {most}: set significant_bits to {bits}" in reader.remark
    whole = PixelReader()
    for _ in range(8):
        whole.frame(raw("rgb16", bits=16))
    assert not whole.remark


def test_more_bits_than_configured_are_refused() -> None:
    with pytest.raises(ImageFormatError, match="significant_bits is 10, values up to 1023, but a"):
        PixelReader(significant_bits=10).frame(raw("bgr16", bits=12))


def test_a_label_can_be_overruled() -> None:
    mislabelled = raw("bgr8")._replace(encoding="rgb8")
    np.testing.assert_array_equal(PixelReader(encoding="bgr8").frame(mislabelled), colours())


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"encoding": "mono8"}, "'mono8' holds no colour"),
        ({"encoding": "mono16"}, "'mono16' holds no colour"),
        ({"encoding": "yuv422"}, "must be one of bgr8, .*, got 'yuv422'"),
        ({"data": bytes(100)}, "of 18 x 12 in bgr8 with step 54 needs 648 bytes, got 100"),
        ({"step": 53}, "needs 648 bytes"),
        ({"encoding": "bayer_rggb16", "step": 37, "data": bytes(37 * 12)}, "step must be even"),
        (
            {"encoding": "bayer_rggb8", "height": 1, "step": 18, "data": bytes(18)},
            "needs 3 x 3 pixels, got 18 x 1",
        ),
    ],
)
def test_what_is_no_picture_is_refused(changes: dict[str, object], sentence: str) -> None:
    image = raw("bgr8")._replace(**changes)  # type: ignore[arg-type]
    with pytest.raises(ImageFormatError, match=sentence):
        PixelReader().frame(image)


def test_pixels_that_need_no_change_are_not_copied() -> None:
    image = raw("bgr8")
    assert np.shares_memory(PixelReader().frame(image), np.frombuffer(image.data, np.uint8))
