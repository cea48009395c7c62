"""metadata.yaml of a rosbag2 folder, version 9."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import yaml

from winding_recorder.bags.channel import Channel

METADATA = "metadata.yaml"
_VERSION = 9


@dataclass(kw_only=True)
class Extent:
    """What one file holds: messages by channel index, first and last stamp [ns].

    Attributes:
        path: Relative to the folder.
        counts: Messages by channel index.
        first_ns: First stamp [ns]; None while there is no message.
        last_ns: Last stamp [ns].
    """

    path: str
    counts: list[int]
    first_ns: int | None = None
    last_ns: int = 0

    def add(self, channel: int, stamp_ns: int) -> None:
        """Count a message."""
        self.counts[channel] += 1
        if self.first_ns is None:
            self.first_ns = self.last_ns = stamp_ns
        elif stamp_ns > self.last_ns:
            self.last_ns = stamp_ns
        elif stamp_ns < self.first_ns:
            self.first_ns = stamp_ns

    @property
    def start(self) -> dict[str, int]:
        """The beginning as metadata.yaml writes it."""
        return {"nanoseconds_since_epoch": self.first_ns or 0}

    @property
    def duration(self) -> dict[str, int]:
        """The length as metadata.yaml writes it."""
        return {"nanoseconds": 0 if self.first_ns is None else self.last_ns - self.first_ns}


@dataclass(frozen=True, kw_only=True)
class Description:
    """What metadata.yaml says of a recording.

    Attributes:
        channels: Recorded topics.
        extents: Of its files.
        notes: Texts by name, the `custom_data` of rosbag2.
    """

    channels: Sequence[Channel]
    extents: Sequence[Extent]
    notes: Mapping[str, str] = field(default_factory=dict)

    def text(self) -> str:
        """Return the file's content."""
        return _dump({"rosbag2_bagfile_information": self.information()})

    def information(self) -> dict[str, Any]:
        """Return the mapping inside metadata.yaml."""
        whole = _whole(self.extents, len(self.channels))
        return {
            "version": _VERSION,
            "storage_identifier": "mcap",
            "duration": whole.duration,
            "starting_time": whole.start,
            "message_count": sum(whole.counts),
            "topics_with_message_count": [
                {
                    "topic_metadata": {
                        "name": channel.name,
                        "type": channel.type_name,
                        "serialization_format": "cdr",
                        "offered_qos_profiles": channel.profiles,
                        "type_description_hash": channel.type_hash,
                    },
                    "message_count": count,
                }
                for channel, count in zip(self.channels, whole.counts, strict=True)
            ],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [extent.path for extent in self.extents],
            "files": [
                {
                    "path": extent.path,
                    "starting_time": extent.start,
                    "duration": extent.duration,
                    "message_count": sum(extent.counts),
                }
                for extent in self.extents
            ],
            "custom_data": dict(self.notes) or None,
            "ros_distro": "jazzy",
        }


def _whole(extents: Sequence[Extent], channels: int) -> Extent:
    filled = [extent for extent in extents if extent.first_ns is not None]
    return Extent(
        path="",
        counts=[sum(extent.counts[k] for extent in extents) for k in range(channels)],
        first_ns=min((extent.first_ns or 0 for extent in filled), default=None),
        last_ns=max((extent.last_ns for extent in filled), default=0),
    )


def _dump(content: Mapping[str, Any]) -> str:
    return yaml.safe_dump(dict(content), sort_keys=False, allow_unicode=True)


def inner_text(description: Description) -> str:
    """Return what a storage file keeps of its own metadata."""
    return _dump(description.information())
