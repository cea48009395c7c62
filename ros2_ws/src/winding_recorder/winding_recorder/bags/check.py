"""Look for damage in a recording: every checksum, every message, every stamp."""

from __future__ import annotations

import sqlite3
from array import array
from collections import ChainMap
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mcap.records import Channel, Message, Schema
from numpy.typing import NDArray

from winding_recorder.bags.check_metadata import Found, FoundTopic, contradictions
from winding_recorder.bags.description import COMPLETE, LOST, REFUSED, YES, BagError, reason
from winding_recorder.bags.mcap_scan import Scan, scan, summary_damage
from winding_recorder.bags.reading import Decoder, read_notes, storage_files

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
        found.inner = _inner_of(connection)
    finally:
        connection.close()


def _inner_of(connection: sqlite3.Connection) -> str:
    row = connection.execute("SELECT metadata FROM metadata ORDER BY id DESC LIMIT 1").fetchone()
    return str(row[0]) if row else ""


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
