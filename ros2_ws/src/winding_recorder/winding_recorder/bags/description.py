"""How a recording describes itself: topics, notes, and metadata.yaml of version 9."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import yaml

# A run without a bag needs none of rosbags, so each function imports what it takes from there.
if TYPE_CHECKING:
    from rosbags.interfaces import Qos

METADATA = "metadata.yaml"
_VERSION = 9
_FOREVER = {"sec": 9223372036, "nsec": 854775807}
# Names of the texts that a recording keeps beside its messages (`custom_data` of rosbag2).
# Whether the recording went on to the end of the run: "yes", or "no: " and the reason.
COMPLETE = "complete"
YES = "yes"
LOST = "lost "  # Before a topic's full name: messages that were published and never arrived
# Before a topic's full name: how many messages arrived and could not be stored, and why.
REFUSED = "not stored "
PARAMETERS = "parameters "  # Before a node's name: its parameters as JSON
RECOVERED = "recovered from"  # The recording that this one was made from, and what was lost with it
# Which run this is, as JSON: id, date, version of the project, versions of libraries, host.
ORIGIN = "origin"


class BagError(ValueError):
    """A recording cannot be read, or not be written where it was asked to."""


def reason(error: BaseException) -> str:
    """Return an error as part of a sentence, never empty and on one line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


_LATEST_NS = 2**63 - 1  # Readers take times for signed numbers of 64 bits


class StoredMessage(NamedTuple):
    """One message of a recording."""

    data: bytes  # CDR bytes.
    arrived_ns: int  # When it reached the recorder, the bag time [ns].
    published_ns: int  # Its own stamp, or when it was sent where it has none [ns].
    sequence: int = 0  # Number that DDS gave it.

    def check(self) -> None:
        """Refuse what a reader could not take.

        Raises:
            BagError: A time is negative, or beyond signed numbers of 64 bits.
        """
        for name, time in (("arrived", self.arrived_ns), ("published", self.published_ns)):
            if not 0 <= time <= _LATEST_NS:
                raise BagError(f"{name} at {time} ns, which must be within 0 to {_LATEST_NS}")


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One recorded topic."""

    name: str  # Full topic name
    type_name: str  # Such as sensor_msgs/msg/JointState
    definition: str  # Text of the type and all its parts, as MCAP's `ros2msg` encoding wants it
    type_hash: str  # RIHS01 hash (REP-2011)
    qos: tuple[Qos, ...]  # Offered profile

    @property
    def profiles(self) -> list[Any]:
        """Offered profiles as metadata.yaml of version 9 writes them."""
        from rosbags.rosbag2.metadata import dump_qos_v9  # noqa: PLC0415

        return list(dump_qos_v9(list(self.qos)))

    @property
    def profiles_text(self) -> str:
        """Offered profiles as one YAML text, as storage files carry them."""
        return yaml.safe_dump(self.profiles, sort_keys=False)


def jazzy_channel(name: str, type_name: str, *, depth: int, latched: bool) -> Channel:
    """Return the channel of a topic of Jazzy's common types, offered reliably.

    Args:
        name: Full topic name.
        type_name: Such as sensor_msgs/msg/JointState.
        depth: History that the publisher keeps.
        latched: Whether it is transient local.

    Raises:
        KeyError: Jazzy has no such type.
    """
    from rosbags.interfaces import (  # noqa: PLC0415
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    definition, type_hash = _definition(type_name)
    forever = QosTime(**_FOREVER)
    durability = QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE
    return Channel(
        name=name,
        type_name=type_name,
        definition=definition,
        type_hash=type_hash,
        qos=(
            Qos(
                history=QosHistory.KEEP_LAST,
                depth=depth,
                reliability=QosReliability.RELIABLE,
                durability=durability,
                deadline=forever,
                lifespan=forever,
                liveliness=QosLiveliness.AUTOMATIC,
                liveliness_lease_duration=forever,
                avoid_ros_namespace_conventions=False,
            ),
        ),
    )


@cache
def _definition(type_name: str) -> tuple[str, str]:
    from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415

    types = get_typestore(Stores.ROS2_JAZZY)
    definition, _ = types.generate_msgdef(type_name, ros_version=2)
    return definition, types.hash_rihs01(type_name)


@dataclass(kw_only=True)
class Extent:
    """What one file holds: messages by channel index, first and last bag time [ns]."""

    path: str  # Relative to the folder
    counts: list[int]  # Messages by channel index
    first_ns: int | None = None  # First bag time [ns]; None while there is no message
    last_ns: int = 0  # Last bag time [ns]

    def add(self, channel: int, arrived_ns: int) -> None:
        """Count a message."""
        self.counts[channel] += 1
        if self.first_ns is None:
            self.first_ns = self.last_ns = arrived_ns
        elif arrived_ns > self.last_ns:
            self.last_ns = arrived_ns
        elif arrived_ns < self.first_ns:
            self.first_ns = arrived_ns

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
    """Content of the metadata.yaml of a recording."""

    channels: Sequence[Channel]  # Recorded topics
    extents: Sequence[Extent]  # Of its files
    # Texts by name, the `custom_data` of rosbag2.
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
