"""Look for damage in a recording: every checksum, every message, every count, every stamp."""

from __future__ import annotations

import sqlite3
from array import array
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_recorder.bags.description import COMPLETE, LOST, YES, BagError
from winding_recorder.bags.mcap_scan import Scan, scan, summary_damage
from winding_recorder.bags.reading import (
    Decoder,
    read_information,
    read_notes,
    reason,
    storage_files,
)

# Of the rhythm of a topic.
_PERIODIC_SHARE = 0.9
_TOLERANCE = 0.05
_GAP = 1.5
_FEW = 10


@dataclass(kw_only=True)
class Verdict:
    """What a check found.

    Attributes:
        stamps: Bag times [ns] by topic, in the order they were stored.
        counts: Messages by file name.
    """

    findings: list[str] = field(default_factory=list)  # What is wrong, one sentence each
    remarks: list[str] = field(default_factory=list)  # What should be known, one sentence each
    stamps: dict[str, array[int]] = field(default_factory=lambda: defaultdict(lambda: array("q")))
    counts: dict[str, int] = field(default_factory=lambda: defaultdict(int))

    @property
    def messages(self) -> int:
        """Messages that were read."""
        return sum(self.counts.values())


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
        messages = _mcap(file, verdict) if file.suffix == ".mcap" else _sqlite(file, verdict)
        _check_messages(file, messages, decoder, verdict)
    if path.is_dir():
        _check_metadata(path, verdict)
    _check_stamps(path, verdict)
    return verdict


Messages = Iterator[tuple[str, str, str, int, bytes]]


def _mcap(path: Path, verdict: Verdict) -> Messages:
    """Yield (topic, type, definition, stamp, bytes) of every message."""
    result = Scan()
    unchecked = chunks = 0
    for chunk in scan(path, result):
        chunks += 1
        unchecked += not chunk.checked
        if chunk.damage:
            verdict.findings.append(f"{path.name}: chunk at byte {chunk.offset}: {chunk.damage}")
        for message in chunk.messages:
            yield _described(path, message, result)
    for message in result.loose:
        yield _described(path, message, result)
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


def _described(path: Path, message: Any, result: Scan) -> tuple[str, str, str, int, bytes]:
    channel = result.channels.get(message.channel_id)
    schema = result.schemas.get(channel.schema_id) if channel else None
    if channel is None or schema is None:
        raise BagError(f"a message of the unknown channel {message.channel_id}")
    definition = schema.data.decode("utf-8", errors="replace")
    return channel.topic, schema.name, definition, message.log_time, message.data


def _sqlite(path: Path, verdict: Verdict) -> Messages:
    """Yield (topic, type, definition, stamp, bytes) of every message."""
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
        topics = {
            key: (name, kind, definitions.get(kind, ""))
            for key, name, kind in connection.execute("SELECT id, name, type FROM topics")
        }
        for key, stamp, data in connection.execute(
            "SELECT topic_id, timestamp, data FROM messages ORDER BY id"
        ):
            yield (*topics[key], stamp, data)
    finally:
        connection.close()


def _check_messages(path: Path, messages: Messages, decoder: Decoder, verdict: Verdict) -> None:
    undecodable: dict[str, str] = {}
    try:
        for topic, kind, definition, stamp, data in messages:
            verdict.stamps[topic].append(stamp)
            verdict.counts[path.name] += 1
            try:
                decoder.learn(kind, definition)
                decoder.decode(kind, data)
            except BagError as error:
                undecodable.setdefault(topic, f"message at {stamp * 1e-9:.6f} s is {error}")
    except Exception as error:  # noqa: BLE001 - damaged bytes raise whatever they hit
        verdict.findings.append(f"{path.name}: cannot be read on: {reason(error)}")
    verdict.findings += [f"{topic}: {text}" for topic, text in undecodable.items()]


def _check_metadata(folder: Path, verdict: Verdict) -> None:
    try:
        information = read_information(folder)
        declared = {
            item["topic_metadata"]["name"]: int(item["message_count"])
            for item in information["topics_with_message_count"]
        }
        total = int(information["message_count"])
        files = {item["path"]: int(item["message_count"]) for item in information["files"]}
        begin = int(information["starting_time"]["nanoseconds_since_epoch"])
        length = int(information["duration"]["nanoseconds"])
    except BagError as error:
        verdict.findings.append(str(error))
        return
    except (KeyError, TypeError, ValueError) as error:
        verdict.findings.append(f"metadata.yaml cannot be understood: {reason(error)}")
        return
    for name in sorted(declared.keys() | verdict.stamps.keys()):
        counted = len(verdict.stamps.get(name, ()))
        if declared.get(name, 0) != counted:
            verdict.findings.append(
                f"{name}: metadata.yaml states {declared.get(name, 0)} messages, "
                f"there are {counted}"
            )
    if total != verdict.messages:
        verdict.findings.append(
            f"metadata.yaml states {total} messages in all, there are {verdict.messages}"
        )
    for name in sorted(files.keys() | verdict.counts.keys()):
        if files.get(name, 0) != verdict.counts.get(name, 0):
            verdict.findings.append(
                f"{name}: metadata.yaml states {files.get(name, 0)} messages, "
                f"there are {verdict.counts.get(name, 0)}"
            )
    first = min((min(stamps) for stamps in verdict.stamps.values()), default=0)
    last = max((max(stamps) for stamps in verdict.stamps.values()), default=0)
    if verdict.messages and (begin, length) != (first, last - first):
        verdict.findings.append(
            f"metadata.yaml states {length * 1e-9:.6f} s from {begin * 1e-9:.6f} s, it is "
            f"{(last - first) * 1e-9:.6f} s from {first * 1e-9:.6f} s"
        )


def _check_stamps(path: Path, verdict: Verdict) -> None:
    notes = read_notes(path) if path.is_dir() else {}
    for name, stamps in sorted(verdict.stamps.items()):
        # The recorder counts losses where one node publishes; there, times are in order.
        ordered = COMPLETE not in notes or f"{LOST}{name}" in notes
        verdict.findings += stamp_findings(name, np.array(stamps, dtype=np.int64), ordered=ordered)
    verdict.findings += [
        f"{key.removeprefix(LOST)}: {text} messages never reached the recorder"
        for key, text in sorted(notes.items())
        if key.startswith(LOST) and text != "0"
    ]
    if notes.get(COMPLETE, YES) != YES:
        verdict.remarks.append(f"the recording ended early: {notes[COMPLETE]}")


def stamp_findings(name: str, stamps: NDArray[np.int64], *, ordered: bool) -> list[str]:
    """Return what is wrong with a topic's bag times, in the order they were stored.

    A topic has a rhythm when nine of ten intervals are within 5 % of their median; then an
    interval of more than one and a half medians is a gap.

    Args:
        name: The topic.
        stamps: Bag times [ns], shape (n,).
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
