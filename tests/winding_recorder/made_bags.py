"""Recordings made without ROS running: joint states, tension, pictures of noise."""

import hashlib
from collections import Counter
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from winding_core.machine.drive import DriveProfile
from winding_core.machine.readings import AxisReading
from winding_recorder.bags.description import (
    COMPLETE,
    LOST,
    YES,
    Channel,
    StoredMessage,
    jazzy_channel,
)
from winding_recorder.bags.mcap_file import BagConfig
from winding_recorder.bags.reading import Decoder
from winding_recorder.bags.writer import BagWriter
from winding_ros import topics
from winding_ros.messages.camera import encode_image
from winding_ros.messages.rig import encode_joint_state, encode_tension
from winding_ros.topic import Topic

RECORDED = (topics.JOINT_STATES, topics.TENSION, topics.IMAGE)
# A tenth of a real frame keeps the tests quick.
FRAME = (64, 96)
READING = AxisReading(
    cylinder_angle=1.0, angular_speed=1.74, carriage_position=0.01, feed_speed=0.005
)


def channel_of(topic: Topic) -> Channel:
    return jazzy_channel(
        f"/winding/{topic.name}", topic.type_name, depth=topic.depth, latched=topic.latched
    )


def storage_file(folder: Path) -> Path:
    (file,) = (path for path in folder.iterdir() if path.suffix in (".mcap", ".db3"))
    return file


def changed(content: bytes, changes: list[tuple[float, bytes]], length: float = 1.0) -> bytes:
    """Return content cut to a share of its length, with bytes replaced at shares of the rest."""
    spoiled = bytearray(content[: round(len(content) * length)])
    for place, other in changes:
        start = int(place * len(spoiled))
        spoiled[start : start + len(other)] = other
    return bytes(spoiled)


class Bags:
    """Makes recordings and looks at them with foreign readers."""

    joints, tension, image = range(3)
    reading_at = staticmethod(DriveProfile().reading_at)

    def __init__(self) -> None:
        self._decoder = Decoder()

    def bytes_of(self, channel: int, data: bytes) -> bytes:
        return self._decoder.canonical(RECORDED[channel].type_name, data)

    @staticmethod
    def writer(folder: Path, notes: dict[str, str] | None = None, **config: object) -> BagWriter:
        return BagWriter(folder, [*map(channel_of, RECORDED)], BagConfig(**config), notes)

    def write_run(self, writer: BagWriter, samples: int, began: int = 0) -> None:
        """Write so many milliseconds of a run; pictures at 200 Hz.

        Args:
            writer: Of the recording.
            samples: Milliseconds.
            began: When the run's time was zero, by the clock of arrivals [ns]; 0 as in recordings
                of before arrival times were recorded.
        """
        rng = np.random.default_rng(7)

        def write(channel: int, data: bytes, number: int) -> None:
            writer.write(channel, StoredMessage(data, began + stamp, stamp, number))

        for sample in range(samples):
            stamp, t = sample * 1_000_000, sample * 1e-3
            joints = self.bytes_of(self.joints, encode_joint_state(t, self.reading_at(t)))
            write(self.joints, joints, sample + 1)
            if sample % 10 == 0:
                tension = self.bytes_of(self.tension, encode_tension(t, 2.5))
                write(self.tension, tension, sample // 10 + 1)
            if sample % 5 == 0:
                frame = rng.integers(0, 256, (*FRAME, 3), dtype=np.uint8)
                image = self.bytes_of(self.image, encode_image(t, frame))
                write(self.image, image, sample // 5 + 1)

    def whole(self, folder: Path, samples: int = 600, began: int = 0, **config: object) -> Path:
        """Return a recording that was closed."""
        writer = self.writer(folder, **config)
        self.write_run(writer, samples, began)
        lost = {f"{LOST}{channel_of(topic).name}": "0" for topic in RECORDED}
        writer.close({COMPLETE: YES, **lost})
        return folder

    @staticmethod
    def as_sqlite(source: Path, folder: Path) -> Path:
        """Copy a recording into SQLite storage, as older recordings and other tools have it."""
        with (
            AnyReader([source]) as reader,
            Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer,
        ):
            links = {
                link.id: writer.add_connection(link.topic, link.msgtype, typestore=reader.typestore)
                for link in reader.connections
            }
            for link, stamp, data in reader.messages():
                writer.write(links[link.id], stamp, data)
        return folder

    @staticmethod
    def messages(folder: Path) -> list[tuple[str, Message]]:
        """Return (topic, message) of the only file of a recording, in the order of arrival."""
        with storage_file(folder).open("rb") as stream:
            return [
                (channel.topic, message)
                for _, channel, message in make_reader(stream).iter_messages()
            ]

    @staticmethod
    def counts(path: Path) -> Counter[str]:
        """Return messages by topic, as rosbags counts them."""
        with AnyReader([path]) as reader:
            return Counter(link.topic for link, _, _ in reader.messages())

    @staticmethod
    def chunks(file: Path) -> list[tuple[int, int, int]]:
        """Return (end of the record [byte], messages, bytes inside) of every chunk of a file."""
        found = []
        with file.open("rb") as stream:
            for record in StreamReader(stream, emit_chunks=True).records:
                if isinstance(record, Chunk):
                    messages = sum(isinstance(item, Message) for item in breakup_chunk(record))
                    found.append((stream.tell(), messages, record.uncompressed_size))
        return found

    @staticmethod
    def fingerprint(folder: Path) -> dict[str, str]:
        return {
            path.name: hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(folder.iterdir())
        }
