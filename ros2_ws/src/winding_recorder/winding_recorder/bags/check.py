"""Look for damage in a recording: every checksum, every message, every stamp."""

from __future__ import annotations

import sqlite3
from array import array
from collections import ChainMap, Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from mcap.records import Channel, Message, Schema
from numpy.typing import NDArray

from winding_recorder.bags.description import COMPLETE, LOST, REFUSED, YES, BagError, reason
from winding_recorder.bags.mcap_scan import Scan, scan, summary_damage
from winding_recorder.bags.reading import (
    LOADER,
    Decoder,
    read_information,
    read_notes,
    storage_files,
)

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
        self.reach(arrived)
        return self.topics[topic]

    def reach(self, moment: int) -> None:
        """Extend first and last to a bag time [ns]."""
        self.first = moment if self.first is None else min(self.first, moment)
        self.last = moment if self.last is None else max(self.last, moment)

    @property
    def messages(self) -> int:
        """Messages in the file."""
        return self.counts.total()


def contradictions(folder: Path, found: Mapping[str, Found]) -> list[str]:
    """Return what metadata.yaml states otherwise than the files, one sentence each."""
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
                whole.reach(moment)
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


# Of the rhythm of a topic.
_PERIODIC_SHARE = 0.9
_TOLERANCE = 0.05
_GAP = 1.5
_FEW = 10
_LATEST = 2**63 - 1
_LATCHED = "durability: transient_local"


@dataclass(kw_only=True)
class Verdict:
    """What a check found."""

    findings: list[str] = field(default_factory=list)  # What is wrong, one sentence each
    remarks: list[str] = field(default_factory=list)  # What should be known, one sentence each
    # What the storage files hold, by file name.
    found: dict[str, Found] = field(default_factory=dict)
    # Times of publication [ns] by topic, in the order of arrival.
    stamps: dict[str, array[int]] = field(default_factory=dict)

    @property
    def messages(self) -> int:
        """Messages that were read."""
        return sum(found.messages for found in self.found.values())


def check(path: Path) -> Verdict:
    """Return what speaks against a recording.

    Args:
        path: A rosbag2 folder, or one storage file.

    Raises:
        BagError: There is no recording at all.
    """
    verdict = Verdict()
    files = storage_files(path)
    decoder = Decoder()
    for file in files:
        found = verdict.found[file.name] = Found()
        read = _mcap if file.suffix == ".mcap" else _sqlite
        _check_messages(file, read(file, found, verdict), decoder, verdict)
    if path.is_dir():
        verdict.findings += contradictions(path, verdict.found)
    _check_stamps(path, verdict)
    return verdict


# Topic, arrival [ns], publication [ns] and bytes of each message.
Messages = Iterator[tuple[str, int, int, bytes]]


def _mcap(path: Path, found: Found, verdict: Verdict) -> Messages:
    """Yield every message of an MCAP file."""
    result = Scan()
    unchecked = chunks = 0
    for chunk in scan(path, result):
        chunks += 1
        unchecked += not chunk.checked
        if chunk.damage:
            verdict.findings.append(f"{path.name}: chunk at byte {chunk.offset}: {chunk.damage}")
        for message in chunk.messages:
            yield _described(message, result, found)
    for message in result.loose:
        yield _described(message, result, found)
    for channel in result.channels.values():
        if channel.schema_id in result.schemas:
            _describe(channel, result.schemas[channel.schema_id], found)
    found.inner = result.notes.get("rosbag2", {}).get("serialized_metadata", "")
    if result.damage:
        verdict.findings.append(
            f"{path.name}: no whole record behind byte {result.end}: {result.damage}"
        )
        return
    if damage := summary_damage(path):
        verdict.findings.append(f"{path.name}: {damage}")
    if len(result.indexes) != chunks:
        verdict.findings.append(
            f"{path.name}: {chunks} chunks, but {len(result.indexes)} in the index"
        )
    if unchecked or not result.data_checked:
        verdict.remarks.append(
            f"{path.name}: {unchecked} of {chunks} chunks without a CRC, data section "
            f"{'with' if result.data_checked else 'without'} one"
        )


def _described(message: Message, result: Scan, found: Found) -> tuple[str, int, int, bytes]:
    channel = result.channels.get(message.channel_id)
    schema = result.schemas.get(channel.schema_id) if channel else None
    if channel is None or schema is None:
        raise BagError(f"a message of the unknown channel {message.channel_id}")
    _describe(channel, schema, found)
    return channel.topic, message.log_time, message.publish_time, message.data


def _describe(channel: Channel, schema: Schema, found: Found) -> None:
    if channel.topic not in found.topics:
        found.topics[channel.topic] = FoundTopic(
            type_name=schema.name,
            definition=schema.data.decode("utf-8", errors="replace"),
            encoding=channel.message_encoding,
            type_hash=channel.metadata.get("topic_type_hash", ""),
            profiles=channel.metadata.get("offered_qos_profiles", ""),
        )


def _sqlite(path: Path, found: Found, verdict: Verdict) -> Messages:
    """Yield every message of a database."""
    connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
    try:
        (whole,) = connection.execute("PRAGMA integrity_check").fetchone()
        if whole != "ok":
            verdict.findings.append(f"{path.name}: {' '.join(str(whole).split())}")
        definitions = dict(
            connection.execute(
                "SELECT topic_type, encoded_message_definition FROM message_definitions"
            )
        )
        names = {}
        for key, name, kind, encoding, profiles, type_hash in connection.execute(
            "SELECT id, name, type, serialization_format, offered_qos_profiles, "
            "type_description_hash FROM topics"
        ):
            names[key] = name
            found.topics[name] = FoundTopic(
                type_name=kind,
                definition=definitions.get(kind, ""),
                encoding=encoding,
                type_hash=type_hash,
                profiles=profiles,
            )
        for key, stamp, data in connection.execute(
            "SELECT topic_id, timestamp, data FROM messages ORDER BY id"
        ):
            yield names[key], stamp, stamp, data
        newest = "SELECT metadata FROM metadata ORDER BY id DESC LIMIT 1"
        for (text,) in connection.execute(newest):
            found.inner = str(text)
    finally:
        connection.close()


def _check_messages(path: Path, messages: Messages, decoder: Decoder, verdict: Verdict) -> None:
    undecodable: dict[str, str] = {}
    found = verdict.found[path.name]
    try:
        for topic, arrived, published, data in messages:
            verdict.stamps.setdefault(topic, array("q")).append(min(published, _LATEST))
            described = found.add(topic, arrived)
            try:
                decoder.learn(described.type_name, described.definition)
                decoder.decode(described.type_name, data)
            except BagError as error:
                undecodable.setdefault(topic, f"message at {arrived * 1e-9:.6f} s is {error}")
    except Exception as error:  # noqa: BLE001 - damaged bytes raise whatever they hit
        verdict.findings.append(f"{path.name}: cannot be read on: {reason(error)}")
    verdict.findings += [f"{topic}: {text}" for topic, text in undecodable.items()]


def _check_stamps(path: Path, verdict: Verdict) -> None:
    notes = read_notes(path) if path.is_dir() else {}
    described = ChainMap(*(found.topics for found in verdict.found.values()))
    for name, stamps in sorted(verdict.stamps.items()):
        # A bag begins with what a latched topic carried before it, perhaps in another run.
        latched = _LATCHED in (described[name].profiles or "")
        judged = np.array(stamps, dtype=np.int64)[int(latched) :]
        # The recorder counts losses where one node publishes; there, times are in order.
        ordered = COMPLETE not in notes or f"{LOST}{name}" in notes
        verdict.findings += stamp_findings(name, judged, ordered=ordered)
    verdict.findings += [
        f"{key.removeprefix(LOST)}: {text} messages never reached the recorder"
        for key, text in sorted(notes.items())
        if key.startswith(LOST) and text != "0"
    ]
    verdict.findings += [
        f"{key.removeprefix(REFUSED)}: {text}"
        for key, text in sorted(notes.items())
        if key.startswith(REFUSED)
    ]
    if notes.get(COMPLETE, YES) != YES:
        verdict.remarks.append(f"the recording ended early: {notes[COMPLETE]}")


def stamp_findings(name: str, stamps: NDArray[np.int64], *, ordered: bool) -> list[str]:
    """Return what is wrong with a topic's stamps, in the order of arrival.

    A topic has a rhythm when nine of ten intervals are within 5 % of their median; then an
    interval of more than one and a half medians is a gap.

    Args:
        name: The topic.
        stamps: [ns], shape (n,).
        ordered: Whether times must not go back; they may where several nodes publish.
    """
    findings = []
    steps = np.diff(stamps)
    back = np.flatnonzero(steps < 0)
    if ordered and back.size:
        findings.append(
            f"{name}: time goes back {back.size} times, first after {stamps[back[0]] * 1e-9:.6f} s"
        )
    period = rhythm(stamps)
    if period is not None:
        gaps = np.flatnonzero(steps > _GAP * period)
        if gaps.size:
            missing = int(np.round(steps[gaps] / period - 1.0).sum())
            findings.append(
                f"{name}: {gaps.size} gaps, about {missing} messages of {1e9 / period:g} Hz, "
                f"first after {stamps[gaps[0]] * 1e-9:.6f} s"
            )
    return findings


def rhythm(stamps: NDArray[np.int64]) -> float | None:
    """Return the period [ns] of a topic that has one."""
    steps = np.diff(stamps)
    if steps.size < _FEW:
        return None
    period = float(np.median(steps))
    if period <= 0.0:
        return None
    regular = np.abs(steps - period) <= _TOLERANCE * period
    return period if regular.mean() >= _PERIODIC_SHARE else None
