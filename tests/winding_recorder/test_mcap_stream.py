"""Files are byte by byte what the writer of the library `mcap` writes."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from mcap.writer import CompressionType, Writer

from winding_recorder.bags.mcap_stream import McapStream
from winding_recorder.bags.sink import Sink

CHANNELS = ("rig/joint_states", "camera/image_raw", "diagnostics")


@pytest.mark.parametrize("compression", ["", "zstd"])
@pytest.mark.parametrize("messages", [0, 1, 700])
def test_the_bytes_are_those_of_the_library(
    tmp_path: Path, compression: str, messages: int
) -> None:
    rng = random.Random(7)
    sink = Sink(tmp_path / "ours.mcap")
    ours = McapStream(sink, profile="ros2", library="both", compression=compression)
    with (tmp_path / "theirs.mcap").open("wb") as file:
        theirs = Writer(
            file,
            chunk_size=2**62,
            compression=CompressionType[compression.upper() or "NONE"],
            enable_data_crcs=True,
        )
        theirs.start(profile="ros2", library="both")
        for writer in (ours, theirs):
            writer.add_metadata("before", {"case": "4", "seed": "0"})
            schema = writer.register_schema("std_msgs/msg/Header", "ros2msg", b"string frame_id")
            for name in CHANNELS:
                writer.register_channel(name, "cdr", schema, {"topic_type_hash": "RIHS01"})
        for k in range(messages):
            channel, data = rng.randint(1, len(CHANNELS)), rng.randbytes(rng.randint(0, 3000))
            # Stamps of topics overlap, and commands may be stamped before what came already.
            stamp = 1_000_000 * k + rng.randint(-5_000_000, 5_000_000) + 10_000_000
            ours.add_message(channel, stamp, data, k)
            theirs.add_message(channel, stamp, data, stamp, k)
            if rng.random() < 0.02:
                ours.flush()
                theirs.flush()
        ours.add_metadata("after", {"complete": "yes"})
        theirs.add_metadata("after", {"complete": "yes"})
        ours.finish()
        theirs.finish()
    sink.close()
    assert (tmp_path / "ours.mcap").read_bytes() == (tmp_path / "theirs.mcap").read_bytes()
