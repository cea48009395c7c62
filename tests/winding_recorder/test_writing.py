"""What the writer puts on the disk, seen by foreign readers."""

import json
import math
import os
import resource
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from made_bags import storage_file
from mcap.reader import make_reader

from winding_recorder.bags.check import check
from winding_recorder.bags.contents import contents
from winding_recorder.bags.description import COMPLETE, BagError, StoredMessage, jazzy_channel
from winding_recorder.bags.mcap_file import CHUNK_BYTES, BagConfig
from winding_recorder.bags.reading import read_notes
from winding_recorder.bags.recover import recover
from winding_ros import topics
from winding_ros.messages.rig import encode_tension

SAMPLES = 600
# Of 600 samples every one, every 10th and every 5th.
COUNTS = {
    "/winding/rig/joint_states": 600,
    "/winding/rig/tension": 60,
    "/winding/camera/image_raw": 120,
}


@pytest.mark.parametrize(
    "config",
    [{}, {"compression": "zstd"}, {"split_bytes": 600_000}],
    ids=["plain", "zstd", "split"],
)
def test_every_way_to_store_is_read_back(bags: Any, tmp_path: Path, config: dict[str, Any]) -> None:
    folder = bags.whole(tmp_path / "bag", SAMPLES, **config)
    assert bags.counts(folder) == COUNTS
    assert check(folder).findings == []


def test_a_split_bag_has_several_files_of_about_the_size(bags: Any, tmp_path: Path) -> None:
    files = sorted(bags.whole(tmp_path / "bag", SAMPLES, split_bytes=600_000).glob("*.mcap"))
    assert len(files) >= 3
    # A file ends with the chunk that passes the size, and with its own description.
    assert all(600_000 <= file.stat().st_size < 600_000 + 2 * CHUNK_BYTES for file in files[:-1])


def test_no_chunk_is_longer_than_its_limit(bags: Any, made: Path) -> None:
    file = storage_file(made)
    sizes = [size for _, _, size in bags.chunks(file)]
    assert len(sizes) > 5
    assert max(sizes) <= CHUNK_BYTES


def test_a_longer_message_has_a_chunk_of_its_own(bags: Any, tmp_path: Path) -> None:
    folder = bags.whole(tmp_path / "bag", 20, chunk_bytes=1000)
    file = storage_file(folder)
    long = [messages for _, messages, size in bags.chunks(file) if size > 10_000]
    assert long
    assert set(long) == {1}
    assert check(folder).findings == []


def test_every_chunk_has_its_crc_and_so_has_the_data_section(made: Path) -> None:
    assert check(made).remarks == []


def test_a_sqlite_recording_is_read_and_whole(bags: Any, made: Path, tmp_path: Path) -> None:
    folder = bags.as_sqlite(made, tmp_path / "sqlite")
    assert bags.counts(folder) == COUNTS
    assert check(folder).findings == []
    assert {topic.name: topic.messages for topic in contents(folder).topics} == COUNTS


def places(content: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the way to every value of nested mappings and lists."""
    inner = content.items() if isinstance(content, dict) else enumerate(content)
    for key, value in inner:
        if isinstance(value, dict | list) and value:
            yield from places(value, (*path, key))
        else:
            yield (*path, key)


def test_metadata_that_contradicts_the_file_is_found(bags: Any, tmp_path: Path) -> None:
    folder = bags.whole(tmp_path / "bag", 30, began=1_700_000_000_000_000_000)
    file = folder / "metadata.yaml"
    text = file.read_text(encoding="utf-8")
    unseen = []
    for *way, last in places(yaml.safe_load(text)):
        content = place = yaml.safe_load(text)
        for key in way:
            place = place[key]
        value = place[last]
        place[last] = value + 7 if isinstance(value, int) else f"{value or ''}x"
        file.write_text(yaml.safe_dump(content), encoding="utf-8")
        if not check(folder).findings:
            unseen.append((*way, last))
    assert unseen == []


def test_a_database_s_metadata_is_held_against_it(bags: Any, made: Path, tmp_path: Path) -> None:
    folder = bags.as_sqlite(made, tmp_path / "sqlite")
    file = folder / "metadata.yaml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("WrenchStamped", "Wrench"), encoding="utf-8")
    (finding,) = check(folder).findings
    assert finding.startswith("/winding/rig/tension: metadata.yaml states type")


def test_bag_times_are_arrivals_and_rates_those_of_each_topic(bags: Any, tmp_path: Path) -> None:
    began = 1_764_000_000_000_000_000
    writer = bags.writer(tmp_path / "bag")
    # One message of half an hour before, stamped zero, makes no bag of 1970 and no other rates.
    early = bags.bytes_of(bags.tension, encode_tension(0.0, 1.5))
    writer.write(bags.tension, StoredMessage(early, began - 1800 * 10**9, 0))
    bags.write_run(writer, 400, began)
    writer.close()
    content = contents(tmp_path / "bag")
    assert content.start == pytest.approx(began * 1e-9 - 1800.0)
    assert content.duration == pytest.approx(1800.399)
    rates = {topic.name.rpartition("/")[2]: topic.rate for topic in content.topics}
    assert rates["joint_states"] == pytest.approx(1000.0)
    assert rates["image_raw"] == pytest.approx(200.0)
    assert check(tmp_path / "bag").findings == []
    sqlite = contents(bags.as_sqlite(tmp_path / "bag", tmp_path / "sqlite"))
    assert {topic.name.rpartition("/")[2]: topic.rate for topic in sqlite.topics} == rates


def test_the_index_in_memory_does_not_grow_with_the_recording(bags: Any, tmp_path: Path) -> None:
    """A file that ends takes its index with it."""
    tracemalloc.start()
    try:
        writer = bags.writer(tmp_path / "bag", split_bytes=400_000, chunk_bytes=2000)
        held = []
        for part in range(4):
            bags.write_run(writer, 200, part * 10**9)
            held.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    writer.close()
    assert 0 < BagConfig().split_bytes < math.inf
    assert len(list((tmp_path / "bag").glob("*.mcap"))) > 4
    # Chunks of 2 kB, one for each picture: 120 of them are in a file at most.
    assert held[3] - held[1] < 200_000


def test_the_seals_of_older_recordings_are_ignored(copied: Path) -> None:
    (copied / "checksums.sha256").write_text(f"{64 * '0'}  bag_0.mcap\n")
    assert check(copied).findings == []


def test_type_hashes_are_those_of_the_installed_messages() -> None:
    wrong = []
    for kind_name in {topic.type_name for topic in topics.TOPICS if topic.recorded}:
        described = jazzy_channel("/x", kind_name, depth=1, latched=False)
        package, kind, name = kind_name.split("/")
        file = Path(sys.prefix) / "share" / package / kind / f"{name}.json"
        stated = {
            item["type_name"]: item["hash_string"]
            for item in json.loads(file.read_text())["type_hashes"]
        }
        if described.type_hash != stated[kind_name]:
            wrong.append(kind_name)
    assert wrong == []


def test_notes_are_in_metadata_and_in_the_file(made: Path) -> None:
    notes = yaml.safe_load((made / "metadata.yaml").read_text())["rosbag2_bagfile_information"][
        "custom_data"
    ]
    file = storage_file(made)
    with file.open("rb") as stream:
        inside = {item.name: item.metadata for item in make_reader(stream).iter_metadata()}
    assert inside["winding_recording"] == notes
    assert "serialized_metadata" in inside["rosbag2"]


def test_an_existing_folder_is_refused(bags: Any, tmp_path: Path) -> None:
    with pytest.raises(BagError, match="never overwritten"):
        bags.writer(tmp_path)


def test_a_bad_choice_is_refused() -> None:
    for config, sentence in [
        ({"compression": "lzma"}, "compression must be one of none, zstd, got 'lzma'"),
        ({"split_bytes": -1}, "split size must not be negative, got -1 bytes"),
    ]:
        with pytest.raises(ValueError, match=sentence):
            BagConfig(**config)


_KILLED = """
import sys, time
from pathlib import Path
sys.path.insert(0, {folder!r})
from made_bags import Bags
writer = Bags.writer(Path(sys.argv[1]))
Bags().write_run(writer, 600)
print(writer.taken, flush=True)
time.sleep(600)
"""


@pytest.mark.slow
def test_a_killed_writer_loses_at_most_its_last_chunk(bags: Any, tmp_path: Path) -> None:
    bag, out = tmp_path / "bag", tmp_path / "out"
    code = _KILLED.format(folder=str(Path(__file__).parent))
    with subprocess.Popen(
        [sys.executable, "-c", code, str(bag)], stdout=subprocess.PIPE, text=True
    ) as process:
        taken = int(process.stdout.readline())
        os.kill(process.pid, signal.SIGKILL)
    before = bags.fingerprint(bag)
    recover(bag, out)
    kept = bags.counts(out)
    assert check(out).findings == []
    assert bags.fingerprint(bag) == before
    # An open chunk holds at most 256 KiB: of each second 1000 samples of 0.2 kB, 100 of 0.1 kB
    # and 200 frames of 18.5 kB, so at most 65 ms.
    assert taken == sum(COUNTS.values())
    for topic, count in COUNTS.items():
        rate = count / 0.6
        assert count - kept[topic] <= 0.065 * rate + 1


def test_a_full_disk_leaves_a_whole_recording_up_to_it(bags: Any, small_disk: Path) -> None:
    writer = bags.writer(small_disk / "bag")
    with pytest.raises(OSError, match=r"No space left|full"):
        bags.write_run(writer, SAMPLES)
    taken = writer.taken
    writer.close({COMPLETE: "no: the disk is full"})
    verdict = check(small_disk / "bag")
    assert verdict.findings == []
    assert verdict.remarks == ["the recording ended early: no: the disk is full"]
    # Nothing that was taken is lost, not even the message that met the full disk.
    assert sum(bags.counts(small_disk / "bag").values()) == taken > 50


def test_a_file_that_may_not_grow_is_still_recovered(bags: Any, tmp_path: Path) -> None:
    """RLIMIT_FSIZE is a wall that no reserve can move."""
    bag, limit = tmp_path / "bag", 700_000
    writer = bags.writer(bag)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            bags.write_run(writer, SAMPLES)
        with pytest.raises(OSError, match="File too large"):
            writer.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    recover(bag, tmp_path / "out")
    assert check(tmp_path / "out").findings == []
    assert sum(bags.counts(tmp_path / "out").values()) > 20


def test_notes_survive_in_the_file_of_a_killed_writer(bags: Any, tmp_path: Path) -> None:
    writer = bags.writer(tmp_path / "bag", {"parameters x": "{}"})
    bags.write_run(writer, 100)
    writer.flush()
    recover(tmp_path / "bag", tmp_path / "out")
    assert read_notes(tmp_path / "out")["parameters x"] == "{}"
