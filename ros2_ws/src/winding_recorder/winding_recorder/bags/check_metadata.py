"""Hold metadata.yaml against what the storage files hold."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from winding_recorder.bags.description import BagError, reason
from winding_recorder.bags.reading import LOADER, read_information

_STORAGES = {".mcap": "mcap", ".db3": "sqlite3"}
# What a storage file keeps of the whole folder's description beside its own.
_KEPT_INSIDE = ("version", "ros_distro", "custom_data")


@dataclass(frozen=True, kw_only=True)
class FoundTopic:
    """A topic as a storage file describes it."""

    type_name: str  # Such as sensor_msgs/msg/JointState
    definition: str  # Text of the type and all its parts
    encoding: str  # Of the messages, such as cdr
    type_hash: str  # RIHS01 hash; empty where there is none
    profiles: str  # Offered QoS profiles as YAML


@dataclass(kw_only=True)
class Found:
    """What is in one storage file."""

    topics: dict[str, FoundTopic] = field(default_factory=dict)  # By full name
    counts: Counter[str] = field(default_factory=Counter)  # Messages by topic
    first: int | None = None  # First bag time [ns]; None without a message
    last: int | None = None  # Last bag time [ns]; None without a message
    inner: str = ""  # The description that the file keeps of itself, as YAML

    def add(self, topic: str, arrived: int) -> FoundTopic:
        """Count a message that arrived at a bag time [ns]; return its topic."""
        self.counts[topic] += 1
        self.first = arrived if self.first is None else min(self.first, arrived)
        self.last = arrived if self.last is None else max(self.last, arrived)
        return self.topics[topic]

    @property
    def messages(self) -> int:
        """Messages in the file."""
        return self.counts.total()


def contradictions(folder: Path, found: Mapping[str, Found]) -> list[str]:
    """Return what metadata.yaml states otherwise than the files, one sentence each.

    Args:
        folder: The recording.
        found: Its storage files by name, in order.
    """
    try:
        return list(_contradictions(read_information(folder), found))
    except BagError as error:
        return [str(error)]
    except (
        KeyError,
        TypeError,
        ValueError,
        AttributeError,
        OverflowError,
        yaml.YAMLError,
    ) as error:
        return [f"metadata.yaml cannot be understood: {reason(error)}"]


def _contradictions(declared: Mapping[str, Any], found: Mapping[str, Found]) -> Iterator[str]:
    files = {item["path"]: item for item in declared["files"]}
    whole = Found()
    for each in found.values():
        whole.topics |= each.topics
        whole.counts += each.counts
        for moment in (each.first, each.last):
            if moment is not None:
                whole.first = moment if whole.first is None else min(whole.first, moment)
                whole.last = moment if whole.last is None else max(whole.last, moment)
    yield from _topics(declared["topics_with_message_count"], whole)
    yield from _span("in all", declared, whole)
    for name in sorted({*files, *found}):
        if name in files and name in found:
            yield from _span(name, files[name], found[name])
        else:
            yield f"{name}: {'there is no such file' if name in files else 'not in metadata.yaml'}"
    for name in ("compression_format", "compression_mode"):
        if str(declared.get(name, "")).upper() not in ("", "NONE"):
            yield f"metadata.yaml states {name} {declared[name]!r}, the files are not compressed"
    paths = [Path(path).name for path in declared["relative_file_paths"]]
    facts: dict[str, tuple[Any, Any]] = {
        "relative_file_paths": (paths, list(found)),
        "storage_identifier": (
            declared["storage_identifier"], _STORAGES[Path(next(iter(found))).suffix],
        ),
    }  # fmt: skip
    for name, fact in _inside([*found.values()][-1]).items():
        facts[name] = (declared.get(name) or None, fact or None)
    for name, (claim, fact) in facts.items():
        if claim != fact:
            yield f"metadata.yaml states {name} {claim!r}, the files {fact!r}"


def _inside(last: Found) -> dict[str, Any]:
    """Return what the last file keeps of the description; nothing where it keeps none."""
    inner = yaml.load(last.inner, LOADER) if last.inner else None
    inner = inner.get("rosbag2_bagfile_information", inner) if isinstance(inner, dict) else {}
    return {name: inner[name] for name in _KEPT_INSIDE if name in inner}


def _topics(declared: list[Mapping[str, Any]], whole: Found) -> Iterator[str]:
    topics = {item["topic_metadata"]["name"]: item for item in declared}
    for name in sorted({*topics, *whole.topics}):
        item = topics.get(name, {})
        count = int(item.get("message_count", 0))
        if count != whole.counts[name]:
            yield f"{name}: metadata.yaml states {count} messages, there are {whole.counts[name]}"
        if not (item and name in whole.topics):
            continue
        described, fact = item["topic_metadata"], whole.topics[name]
        for key, claim, value in (
            ("type", described["type"], fact.type_name),
            ("serialization_format", described["serialization_format"], fact.encoding),
            ("type_description_hash", described.get("type_description_hash", ""), fact.type_hash),
            (
                "offered_qos_profiles",
                _data(described["offered_qos_profiles"]),
                _data(fact.profiles),
            ),
        ):
            if (claim or None) != (value or None):
                yield f"{name}: metadata.yaml states {key} {claim!r}, the file {value!r}"


def _data(declared: Any) -> Any:
    """Return QoS profiles as data; they are text inside storage files and before version 9."""
    return yaml.load(declared, LOADER) if isinstance(declared, str) else declared


def _span(name: str, declared: Mapping[str, Any], found: Found) -> Iterator[str]:
    count = int(declared["message_count"])
    if count != found.messages:
        yield f"{name}: metadata.yaml states {count} messages, there are {found.messages}"
    begin = int(declared["starting_time"]["nanoseconds_since_epoch"])
    length = int(declared["duration"]["nanoseconds"])
    first, last = found.first or 0, found.last or 0
    if found.messages and (begin, length) != (first, last - first):
        yield (
            f"{name}: metadata.yaml states {length * 1e-9:.6f} s from {begin * 1e-9:.6f} s, it is "
            f"{(last - first) * 1e-9:.6f} s from {first * 1e-9:.6f} s"
        )
