"""Recorded pictures: their times, their encodings, and those that cannot be used."""

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from marker_tracker_node.camera.frame_sources import FrameSource, FrameTimeError, FrameTimes
from marker_tracker_node.camera.recordings import RecordingError
from winding_core.image_formats import PixelReader

# A millisecond [s], and what a time may lose in the container [s].
TICK, ROUNDING = 1.0e-3, 1.0e-6


def written(path: Path, pictures: int, rate: float) -> Path:
    """Write a video of grey pictures, each a little lighter than the one before."""
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), rate, (64, 48))
    for k in range(pictures):
        video.write(np.full((48, 64, 3), 4 * k, np.uint8))
    video.release()
    return path


def retimed(path: Path, steps: list[int]) -> Path:
    """Give the pictures of an mp4 durations of their own, in ticks of its time scale."""
    data = bytearray(path.read_bytes())
    at = data.index(b"stts")
    size = struct.unpack_from(">I", data, at - 4)[0]
    # The table of one entry for all pictures becomes one of an entry each; it moves to the end
    # of the boxes around it, which grow by as much.
    table = struct.pack(">I", len(steps)) + b"".join(struct.pack(">II", 1, s) for s in steps)
    new = struct.pack(">I4sI", 12 + len(table), b"stts", 0) + table
    grown = len(new) - size
    for name in (b"moov", b"trak", b"mdia", b"minf", b"stbl"):
        place = data.index(name) - 4
        struct.pack_into(">I", data, place, struct.unpack_from(">I", data, place)[0] + grown)
    data[at - 4 : at - 4 + size] = new
    path.write_bytes(data)
    return path


def scale(path: Path) -> int:
    """Return the ticks a second of an mp4's track."""
    data = path.read_bytes()
    return int(struct.unpack_from(">I", data, data.index(b"mdhd") + 16)[0])


@pytest.mark.parametrize("steps_ms", [[40, 10, 90, 20, 40, 40, 5, 40], [8, 8, 31, 8, 8, 12, 8, 8]])
def test_a_video_keeps_its_own_times(tmp_path: Path, steps_ms: list[int]) -> None:
    # Slow as written: an edit list of the file limits how long it may last at most.
    path = written(tmp_path / "film.mp4", len(steps_ms), 1.0)
    ticks = [round(step * TICK * scale(path)) for step in steps_ms]
    source = FrameSource(retimed(path, ticks))
    times = [t for t, _ in source]
    np.testing.assert_allclose(times, TICK * np.cumsum([0, *steps_ms[:-1]]), atol=1.0 / scale(path))
    (remark,) = source.remarks()
    low, high = min(steps_ms[:-1]), max(steps_ms[:-1])
    assert f"unevenly spaced: {low:.1f} to {high:.1f} ms apart" in remark
    assert "their own are used" in remark


def test_even_times_need_no_word(tmp_path: Path) -> None:
    source = FrameSource(written(tmp_path / "film.mp4", 6, 30.0))
    assert [t for t, _ in source] == pytest.approx(np.arange(6) / 30.0, abs=ROUNDING)
    assert source.remarks() == []


def test_a_rate_that_contradicts_a_video_is_used_and_reported(tmp_path: Path) -> None:
    source = FrameSource(written(tmp_path / "film.mp4", 6, 25.0), fps=1000.0)
    assert [t for t, _ in source] == pytest.approx(np.arange(6) / 1000.0)
    assert source.remarks() == [
        "film.mp4 has 25 pictures a second, 1000 were given: those are used"
    ]
    agreeing = FrameSource(tmp_path / "film.mp4", fps=25.0)
    assert len(list(agreeing)) == 6
    assert agreeing.remarks() == []


def folder(tmp_path: Path, times: list[str]) -> Path:
    rows = []
    for k, t in enumerate(times):
        cv2.imwrite(str(tmp_path / f"{k}.png"), np.full((8, 8, 3), 50 + k, np.uint8))
        rows.append(f"{k}.png,{t}")
    (tmp_path / "frames.csv").write_text("\n".join(["file,t", *rows]), encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("times", "sentence"),
    [
        (["0", "0.1", "0.05"], "picture 3 is at 0.050000 s, before the 0.100000 s of the one"),
        (["0", "0", "0", "0"], "the first 3 pictures are all at 0 s, and times must ascend"),
        (["0", "nan", "1"], "picture 2 is at nan s, which must be finite"),
    ],
)
def test_times_that_cannot_be_used_are_refused(
    tmp_path: Path, times: list[str], sentence: str
) -> None:
    with pytest.raises(RecordingError, match=sentence):
        list(FrameSource(folder(tmp_path, times)))


def test_a_rate_beside_a_list_of_times_is_reported(tmp_path: Path) -> None:
    source = FrameSource(folder(tmp_path, ["0", "0.02", "0.04", "0.1"]), fps=30.0)
    assert [t for t, _ in source] == [0.0, 0.02, 0.04, 0.1]
    first, second = source.remarks()
    assert first == "frames.csv has 50 pictures a second, 30 were given: its own are used"
    assert "20.0 to 60.0 ms apart" in second


@pytest.mark.parametrize("fps", [0.0, -25.0, float("nan")])
def test_a_rate_that_is_none_is_refused(tmp_path: Path, fps: float) -> None:
    with pytest.raises(RecordingError, match="must be positive and finite"):
        FrameSource(tmp_path, fps=fps)


def test_single_old_pictures_of_a_stream_are_left_to_the_tracker() -> None:
    times = FrameTimes("a bag", backwards=True)
    assert [times.take(t) for t in (0.0, 0.2, 0.1, 0.3)] == [0.0, 0.2, 0.1, 0.3]
    with pytest.raises(FrameTimeError, match="the first 3 pictures are all at 7 s"):
        [FrameTimes.take(stamps, 7.0) for stamps in [FrameTimes("a bag")] for _ in range(3)]


STORE = get_typestore(Stores.ROS2_JAZZY)
KIND = "sensor_msgs/msg/Image"
ROWS, COLUMNS = 8, 10
# Red cells at (0, 0), blue at (1, 1).
RED, GREEN, BLUE = 3000, 2000, 500


def mosaic() -> np.ndarray:
    picture = np.full((ROWS, COLUMNS), GREEN, dtype=">u2")
    picture[0::2, 0::2] = RED
    picture[1::2, 1::2] = BLUE
    return picture


def bag(path: Path, pictures: list[bytes], encoding: str, step: int, big: int) -> Path:
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        link = writer.add_connection("/eye", KIND, typestore=STORE)
        for k, data in enumerate(pictures):
            stamp = STORE.types["builtin_interfaces/msg/Time"](sec=k, nanosec=0)
            header = STORE.types["std_msgs/msg/Header"](stamp=stamp, frame_id="eye")
            message = STORE.types[KIND](
                header=header, height=ROWS, width=COLUMNS, encoding=encoding,
                is_bigendian=big, step=step, data=np.frombuffer(data, np.uint8),
            )  # fmt: skip
            writer.write(link, k * 10**9, STORE.serialize_cdr(message, KIND))
    return path


def test_twelve_bits_of_a_mosaic_with_padding_and_high_bytes_first(tmp_path: Path) -> None:
    padding = 6
    rows = np.hstack([mosaic().view(np.uint8), np.zeros((ROWS, padding), np.uint8)])
    path = bag(tmp_path / "bag", [rows.tobytes()] * 3, "bayer_rggb16", rows.shape[1], 1)
    source = FrameSource(path, reader=PixelReader(significant_bits=12))
    frames = [frame for _, frame in source]
    assert len(frames) == 3
    assert (frames[0] == np.array([BLUE, GREEN, RED]) >> 4).all()
    assert source.remarks() == []


def test_bits_that_are_not_configured_are_noticed(tmp_path: Path) -> None:
    path = bag(tmp_path / "bag", [mosaic().tobytes()] * 9, "bayer_rggb16", 2 * COLUMNS, 1)
    source = FrameSource(path)
    assert len(list(source)) == 9
    (remark,) = source.remarks()
    assert f"no value in 9 pictures of 16 bits is above {RED}: set significant_bits to 12" in remark


def test_incomplete_pictures_are_left_out_and_counted(tmp_path: Path) -> None:
    whole = bytes(3 * COLUMNS * ROWS)
    path = bag(tmp_path / "bag", [whole, whole[:-40], whole], "rgb8", 3 * COLUMNS, 0)
    source = FrameSource(path)
    assert [t for t, _ in source] == [0.0, 2.0]
    assert source.remarks() == ["1 x image of 10 x 8 in rgb8 with step 30 needs 240 bytes, got 200"]


def test_a_bag_without_colours_is_refused_with_the_reason(tmp_path: Path) -> None:
    path = bag(tmp_path / "bag", [bytes(COLUMNS * ROWS)] * 4, "mono8", COLUMNS, 0)
    with pytest.raises(RecordingError, match="'mono8' holds no colour, and markers are"):
        list(FrameSource(path))
