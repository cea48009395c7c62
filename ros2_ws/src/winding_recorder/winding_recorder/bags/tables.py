"""Messages of a recording as tables: one row per message, or per point of a cloud."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.csv as pa_csv  # type: ignore[import-untyped]
import pyarrow.parquet as pa_parquet  # type: ignore[import-untyped]

from winding_recorder.bags.description import BagError, reason
from winding_recorder.bags.reading import decoded, opened, stamped_messages

FORMATS = ("csv", "parquet")
_NANO = 1_000_000_000
_CLOUD = "sensor_msgs/msg/PointCloud2"
_JOINTS = "sensor_msgs/msg/JointState"
_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_MARKER = "visualization_msgs/msg/Marker"
_PICTURES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
_STAMPS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
# PointField datatypes in their order, from 1.
_POINT_TYPES = ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")
_BATCH = 20_000  # A batch of rows at a time keeps a long recording out of memory
_LONGEST_LIST = 64  # A list whose length changes from message to message has no columns of its own

Row = dict[str, Any]


def export(path: Path, folder: Path, form: str, wanted: frozenset[str] = frozenset()) -> list[Path]:
    """Write a table for every topic; return the files.

    Column `t` is the message's stamp [s], column `arrival` the bag time [s]. A cloud gives a row
    per point, with its fields as columns; a line marker gives a row per point as well.
    Pixels stay in the bag: a picture's table has its sizes.

    Args:
        path: The recording.
        folder: New folder of tables.
        form: "csv" or "parquet".
        wanted: Full topic names; empty for all.

    Raises:
        BagError: The recording cannot be read, or has no such topic; the folder exists.
        OSError: A table cannot be written.
    """
    if form not in FORMATS:
        raise BagError(f"format must be one of {', '.join(FORMATS)}, got {form!r}")
    if folder.exists():
        raise BagError(f"{folder} exists already; tables are never written over others")
    with opened(path) as reader:
        known = {link.topic for link in reader.connections}
        if missing := sorted(wanted - known):
            raise BagError(f"{path} has no topic {missing[0]}; it has {', '.join(sorted(known))}")
        folder.mkdir(parents=True)
        written = []
        for link in reader.connections:
            if wanted and link.topic not in wanted:
                continue
            messages = (
                [
                    {**row, "arrival": arrived / _NANO}
                    for row in rows_of(stamp, decoded(reader, link, data))
                ]
                for link, stamp, arrived, data in stamped_messages(reader, [link])
            )
            target = folder / f"{link.topic.strip('/').replace('/', '.')}.{form}"
            if _write(target, form, _batches(messages)):
                written.append(target)
    return written


def topic_rows(path: Path, name: str) -> list[list[Row]]:
    """Return every message of the topic with that last name, as rows; at least one message.

    Raises:
        BagError: The recording cannot be read, or does not hold the topic once.
    """
    with opened(path) as reader:
        links = [link for link in reader.connections if f"/{link.topic}".endswith(f"/{name}")]
        if len(links) != 1:
            raise BagError(f"{path} must hold {name} once, it holds {len(links)} of it")
        messages = [
            rows_of(stamp, decoded(reader, link, data))
            for link, stamp, _, data in stamped_messages(reader, links)
        ]
    if not messages:
        raise BagError(f"{name} of {path} is empty")
    return messages


def rows_of(stamp_ns: int, message: Any) -> list[Row]:
    """Return one message as rows of named values.

    Raises:
        BagError: Its numbers contradict each other.
    """
    t = stamp_ns / _NANO
    try:
        return _rows(t, message)
    except (ValueError, IndexError, TypeError) as error:
        raise BagError(
            f"a {message.__msgtype__} at {t:.6f} s contradicts itself: {reason(error)}"
        ) from error


def _rows(t: float, message: Any) -> list[Row]:
    kind = message.__msgtype__
    if kind == _CLOUD:
        return [{"t": t, **point} for point in _points(message)]
    if kind == _JOINTS:
        return [{"t": t, **_joints(message)}]
    if kind == _MARKER:
        points = enumerate(message.points)
        return [{"t": t, "point": k, "x": p.x, "y": p.y, "z": p.z} for k, p in points]
    if kind == _DIAGNOSTICS:
        return [{"t": t, **entry} for entry in _entries(message)]
    row = {"t": t}
    for name in message.__dataclass_fields__:
        if name in ("__msgtype__", "header") or (kind in _PICTURES and name == "data"):
            continue
        row |= _columns(name, getattr(message, name))
    return [row]


def _points(message: Any) -> list[Row]:
    dtype = np.dtype(
        {
            "names": [field.name for field in message.fields],
            "formats": [f"<{_POINT_TYPES[field.datatype - 1]}" for field in message.fields],
            "offsets": [field.offset for field in message.fields],
            "itemsize": message.point_step,
        }
    )
    records = np.frombuffer(message.data, dtype=dtype, count=message.width * message.height)
    return [dict(zip(dtype.names or (), record.item(), strict=True)) for record in records]


def _joints(message: Any) -> Row:
    row: Row = {}
    for quantity in ("position", "velocity", "effort"):
        for name, value in zip(message.name, getattr(message, quantity), strict=False):
            row[f"{name}.{quantity}"] = float(value)
    return row


def _entries(message: Any) -> Iterable[Row]:
    for status in message.status:
        own = {"name": status.name, "level": int(status.level), "message": status.message}
        for item in status.values or [None]:
            yield own | {"key": item.key if item else "", "value": item.value if item else ""}


def _columns(name: str, value: Any) -> Row:
    if getattr(value, "__msgtype__", None) in _STAMPS:
        return {name: value.sec + value.nanosec / _NANO}
    if hasattr(value, "__msgtype__"):
        columns: Row = {}
        for part in value.__dataclass_fields__:
            if part != "__msgtype__":
                columns |= _columns(f"{name}.{part}", getattr(value, part))
        return columns
    if isinstance(value, np.ndarray | list | tuple):
        if len(value) > _LONGEST_LIST:
            return {f"{name}.length": len(value)}
        columns = {}
        for k, item in enumerate(value):
            columns |= _columns(f"{name}.{k}", item)
        return columns
    return {name: value.item() if isinstance(value, np.generic) else value}


def _batches(messages: Iterable[list[Row]]) -> Iterable[list[Row]]:
    rows: list[Row] = []
    for own in messages:
        rows += own
        if len(rows) >= _BATCH:
            yield rows
            rows = []
    yield rows


def _write(target: Path, form: str, batches: Iterable[list[Row]]) -> bool:
    """Write rows; the first batch decides on the columns. Return whether there was any row."""
    writer: Any = None
    schema: pa.Schema | None = None
    try:
        for rows in batches:
            if not rows:
                continue
            names: Mapping[str, None] = dict.fromkeys(name for row in rows for name in row)
            table = pa.table({name: [row.get(name) for row in rows] for name in names})
            if schema is None:
                schema = table.schema
                opener = pa_csv.CSVWriter if form == "csv" else pa_parquet.ParquetWriter
                writer = opener(target, schema)
            writer.write_table(_fitted(table, schema))
    finally:
        if writer is not None:
            writer.close()
    return schema is not None


def _fitted(table: pa.Table, schema: pa.Schema) -> pa.Table:
    columns = [
        table.column(item.name).cast(item.type)
        if item.name in table.column_names
        else pa.nulls(len(table), item.type)
        for item in schema
    ]
    return pa.table(columns, schema=schema)
