"""Pictures of a bag in a camera's own encoding; those that cannot be read are counted and said."""

from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from marker_tracker_node.camera.frame_sources import FrameSource
from marker_tracker_node.camera.image_formats import PixelReader
from marker_tracker_node.camera.recordings import RecordingError

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


def test_bits_that_nobody_told_are_noticed(tmp_path: Path) -> None:
    path = bag(tmp_path / "bag", [mosaic().tobytes()] * 9, "bayer_rggb16", 2 * COLUMNS, 1)
    source = FrameSource(path)
    assert len(list(source)) == 9
    (said,) = source.remarks()
    assert f"no value in 9 pictures of 16 bits is above {RED}: set significant_bits to 12" in said


def test_incomplete_pictures_are_left_out_and_counted(tmp_path: Path) -> None:
    whole = bytes(3 * COLUMNS * ROWS)
    path = bag(tmp_path / "bag", [whole, whole[:-40], whole], "rgb8", 3 * COLUMNS, 0)
    source = FrameSource(path)
    assert [t for t, _ in source] == [0.0, 2.0]
    assert source.remarks() == ["1 x image of 10 x 8 in rgb8 with step 30 needs 240 bytes, got 200"]


def test_a_bag_without_colours_is_refused_with_the_reason(tmp_path: Path) -> None:
    path = bag(tmp_path / "bag", [bytes(COLUMNS * ROWS)] * 4, "mono8", COLUMNS, 0)
    with pytest.raises(RecordingError, match="'mono8' holds no colour"):
        list(FrameSource(path))
