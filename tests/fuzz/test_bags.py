"""Made-up recordings: read, checked, recovered or refused by BagError; never a crash or a hang."""

import shutil
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from made_bags import Bags, changed, storage_file
from made_up import write_database

from marker_tracker_node.camera.frame_sources import FrameSource, read_bag
from marker_tracker_node.camera.recordings import RecordingError
from winding_recorder.bags.check import check
from winding_recorder.bags.contents import contents
from winding_recorder.bags.description import METADATA, BagError
from winding_recorder.bags.reading import opened, read_notes, stamped_messages
from winding_recorder.bags.recover import recover
from winding_recorder.bags.tables import export

fuzzed = settings.get_profile("files")
RANDOM_BYTES = [b"\x00", b"\xff", b"\x7f\xff\xff\xff", b"\xff" * 8, b"\x00" * 9]
MOST_BYTES = 400_000_000  # A small file must not make a reader take much more than it holds


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Storage files by kind."""
    place, bags = tmp_path_factory.mktemp("whole"), Bags()
    plain = bags.whole(place / "plain", 30, chunk_bytes=2000)
    packed = bags.whole(place / "packed", 30, chunk_bytes=2000, compression="zstd")
    return {
        "plain.mcap": storage_file(plain).read_bytes(),
        "packed.mcap": storage_file(packed).read_bytes(),
        "base.db3": storage_file(bags.as_sqlite(plain, place / "base")).read_bytes(),
    }


@pytest.fixture
def bounded() -> Any:
    """Let the process have so much more memory and no more."""
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MOST_BYTES, hard))
    yield
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def try_everything(path: Path, scratch: Path) -> set[str]:
    """Do with a recording what a person can do with it; return what was refused."""
    actions: dict[str, Callable[[], Any]] = {
        "check": lambda: check(path),
        "contents": lambda: contents(path),
        "notes": lambda: read_notes(path if path.is_dir() else path.parent),
        "recover": lambda: recover(path, scratch / "out"),
        "export": lambda: export(path, scratch / "tables", "csv"),
        "track": lambda: (read_bag(path), list(FrameSource(path))),
        "play": lambda: drained(path),
    }
    refused = {}
    for name, action in actions.items():
        try:
            action()
        except (BagError, RecordingError) as error:
            refused[name] = str(error)
        finally:
            for left in ("out", "tables"):
                shutil.rmtree(scratch / left, ignore_errors=True)
    assert all(sentence and "\n" not in sentence for sentence in refused.values())
    return set(refused)


def drained(path: Path) -> None:
    with opened(path) as reader:
        for _ in stamped_messages(reader, list(reader.connections)):
            pass


KINDS = ["plain.mcap", "packed.mcap", "base.db3"]
changes = st.lists(
    st.tuples(
        st.floats(0.0, 1.0, exclude_max=True),
        st.one_of(st.sampled_from(RANDOM_BYTES), st.binary(min_size=1, max_size=9)),
    ),
    max_size=6,
)


@pytest.mark.usefixtures("bounded")
@pytest.mark.parametrize("kind", KINDS)
@fuzzed
@given(changes=changes, length=st.one_of(st.just(1.0), st.floats(0.0, 1.0)))
def test_changed_and_cut_storage(
    whole: dict[str, bytes],
    tmp_path: Path,
    kind: str,
    changes: list[tuple[float, bytes]],
    length: float,
) -> None:
    file = tmp_path / f"bag_0{Path(kind).suffix}"
    file.write_bytes(changed(whole[kind], changes, length))
    try_everything(file, tmp_path)


@pytest.mark.usefixtures("bounded")
@pytest.mark.parametrize("suffix", [".mcap", ".db3"])
@fuzzed
@given(
    garbage=st.binary(max_size=300),
    start=st.sampled_from([b"", b"\x89MCAP0\r\n", b"SQLite format 3\x00"]),
    end=st.sampled_from([b"", b"\x89MCAP0\r\n"]),
)
def test_garbage(tmp_path: Path, suffix: str, garbage: bytes, start: bytes, end: bytes) -> None:
    file = tmp_path / f"bag_0{suffix}"
    file.write_bytes(start + garbage + end)
    assert {"contents", "recover"} <= try_everything(file, tmp_path)
    assert check(file).findings


def record(opcode: int, body: bytes, length: int | None = None) -> bytes:
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def chunk(records: bytes, *, claimed: int, packing: bytes, crc: int) -> bytes:
    return record(
        6,
        struct.pack("<QQQI", 0, 1, claimed, crc)
        + struct.pack("<I", len(packing))
        + packing
        + struct.pack("<Q", len(records))
        + records,
    )


sizes = st.one_of(st.integers(0, 300), st.integers(0, 2**63), st.just(2**64 - 1))


@pytest.mark.usefixtures("bounded")
@fuzzed
@given(
    bodies=st.lists(st.tuples(st.integers(0, 20), st.binary(max_size=60), st.none() | sizes)),
    claimed=sizes,
    packing=st.sampled_from([b"", b"zstd", b"lz4", b"\xff"]),
    compressed=st.booleans(),
    inside=st.binary(max_size=100),
    right=st.booleans(),
)
def test_made_up_records_and_chunks(
    tmp_path: Path,
    bodies: list[tuple[int, bytes, int | None]],
    claimed: int,
    packing: bytes,
    compressed: bool,
    inside: bytes,
    right: bool,
) -> None:
    zstandard = pytest.importorskip("zstandard")
    stored = zstandard.compress(inside) if compressed else inside
    content = b"\x89MCAP0\r\n" + b"".join(record(*body) for body in bodies)
    crc = zlib.crc32(inside) if right else 1
    content += chunk(stored, claimed=claimed, packing=packing, crc=crc)
    content += record(2, bytes(20)) + b"\x89MCAP0\r\n"
    file = tmp_path / "bag_0.mcap"
    file.write_bytes(content)
    try_everything(file, tmp_path)


values = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.floats(),
        st.text(max_size=20),
        st.sampled_from([2**63, -1, "../../x", "/etc/passwd", "sqlite3", "mcap", 10**400]),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=6), inner, max_size=3)
    ),
    max_leaves=8,
)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["plain.mcap", "base.db3"])
@fuzzed
@given(data=st.data())
def test_changed_metadata(
    whole: dict[str, bytes], tmp_path: Path, kind: str, data: st.DataObject
) -> None:
    folder = tmp_path / "bag"
    if not folder.exists():
        source = folder if kind.endswith("mcap") else tmp_path / "source"
        Bags().whole(source, 30, chunk_bytes=2000)
        if source != folder:
            Bags.as_sqlite(source, folder)
        shutil.copyfile(folder / METADATA, tmp_path / "metadata")
    content = yaml.safe_load((tmp_path / "metadata").read_text("utf-8"))
    place = content["rosbag2_bagfile_information"]
    name = data.draw(st.sampled_from(sorted(place)))
    while isinstance(place[name], dict | list) and place[name] and data.draw(st.booleans()):
        place = place[name]
        keys = sorted(place) if isinstance(place, dict) else list(range(len(place)))
        name = data.draw(st.sampled_from(keys))
    place[name] = data.draw(values)
    try:
        text = yaml.safe_dump(content)
    except ValueError:
        return
    (folder / METADATA).write_text(text, "utf-8")
    try_everything(folder, tmp_path)


@pytest.mark.slow
@fuzzed
@given(text=st.one_of(st.text(max_size=100), values.map(repr)))
def test_any_metadata(whole: dict[str, bytes], tmp_path: Path, text: str) -> None:
    folder = tmp_path / "bag"
    folder.mkdir(exist_ok=True)
    (folder / "bag_0.mcap").write_bytes(whole["plain.mcap"])
    (folder / METADATA).write_text(text, "utf-8")
    assert "contents" in try_everything(folder, tmp_path)
    assert check(folder).findings


rows = st.one_of(st.none(), st.integers(-(2**63), 2**63 - 1), st.text(max_size=20), st.binary())


@fuzzed
@given(
    topic=st.tuples(rows, rows, rows, rows, rows, rows),
    kind=st.tuples(rows, rows, rows, rows, rows),
    message=st.tuples(rows, rows, rows),
    dropped=st.sampled_from(
        ["", "topics", "messages", "message_definitions", "metadata", "schema"]
    ),
)
def test_a_database_that_holds_anything(
    tmp_path: Path,
    topic: tuple[Any, ...],
    kind: tuple[Any, ...],
    message: tuple[Any, ...],
    dropped: str,
) -> None:
    file = tmp_path / "bag_0.db3"
    file.unlink(missing_ok=True)
    write_database(
        file,
        topics=[topic],
        types=[kind],
        messages=[(1, *message), (2, topic[0], 0, b"\x00\x01\x00\x00")],
        dropped=dropped,
    )
    try_everything(file, tmp_path)
