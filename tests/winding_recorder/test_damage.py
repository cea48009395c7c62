"""Cut, flipped and made-up bytes: damage is always seen, and what is whole is always kept."""

import random
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml
from made_bags import storage_file
from mcap.reader import make_reader

from winding_recorder.bags.check import check
from winding_recorder.bags.contents import contents
from winding_recorder.bags.description import BagError, StoredMessage
from winding_recorder.bags.reading import opened
from winding_recorder.bags.recover import recover

pytestmark = [pytest.mark.campaign, pytest.mark.slow]

FLIPS_PER_FILE = 120
CUTS = 100


def flipped(path: Path, position: int, bit: int) -> None:
    content = bytearray(path.read_bytes())
    content[position] ^= 1 << bit
    path.write_bytes(content)


def positions(size: int, count: int) -> list[int]:
    """Both ends, which hold magic, header and footer, and places all over the file."""
    ends = [*range(40), *range(size - 40, size)]
    rng = random.Random(11)
    return sorted({*ends, *(rng.randrange(size) for _ in range(count - len(ends)))})


@pytest.fixture
def small(bags: Any, tmp_path: Path) -> Path:
    return bags.whole(tmp_path / "bag", 60)


def test_every_flipped_bit_is_seen(small: Path) -> None:
    file = storage_file(small)
    whole = file.read_bytes()
    rng = random.Random(5)
    unseen = []
    for position in positions(len(whole), FLIPS_PER_FILE):
        flipped(file, position, rng.randrange(8))
        if not check(small).findings:
            unseen.append(position)
        file.write_bytes(whole)
    assert unseen == []
    assert check(small).findings == []


def test_a_torn_database_is_seen(bags: Any, small: Path, tmp_path: Path) -> None:
    folder = bags.as_sqlite(small, tmp_path / "sqlite")
    assert check(folder).findings == []
    file = storage_file(folder)
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    assert check(folder).findings


def test_a_database_is_refused_by_recovery(bags: Any, small: Path, tmp_path: Path) -> None:
    folder = bags.as_sqlite(small, tmp_path / "sqlite")
    with pytest.raises(BagError, match=r"only MCAP files are recovered, sqlite\S*\.db3 is none"):
        recover(folder, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_damaged_chunk_is_named_with_its_place(bags: Any, copied: Path, tmp_path: Path) -> None:
    file = storage_file(copied)
    end, _, _ = bags.chunks(file)[2]
    flipped(file, end - 5000, 3)
    assert any(
        "chunk at byte" in finding and "crc" in finding for finding in check(copied).findings
    )


def test_metadata_that_disagrees_is_found(copied: Path) -> None:
    file = copied / "metadata.yaml"
    content = yaml.safe_load(file.read_text())
    information = content["rosbag2_bagfile_information"]
    information["topics_with_message_count"][0]["message_count"] += 1
    file.write_text(yaml.safe_dump(content))
    findings = check(copied).findings
    assert "/winding/rig/joint_states: metadata.yaml states 601 messages, there are 600" in findings


def test_a_gap_and_a_step_back_are_found(bags: Any, tmp_path: Path) -> None:
    writer = bags.writer(tmp_path / "bag")
    full = bags.whole(tmp_path / "full", 200)
    with opened(full) as reader:
        joints = [(t, bytes(d)) for c, t, d in reader.messages() if "joint" in c.topic]
    for stamp, data in [*joints[:100], *joints[110:150], joints[120], *joints[150:]]:
        writer.write(bags.joints, StoredMessage(data, stamp, stamp))
    writer.close()
    findings = check(tmp_path / "bag").findings
    name = "/winding/rig/joint_states"
    assert f"{name}: time goes back 1 times, first after 0.149000 s" in findings
    # Ten samples are missing, and the step back to sample 120 opens another hole of 29.
    assert any(f"{name}: 2 gaps, about 39 messages of 1000 Hz" in text for text in findings)


def test_lost_messages_are_findings(bags: Any, tmp_path: Path) -> None:
    writer = bags.writer(tmp_path / "bag")
    bags.write_run(writer, 20)
    writer.close({"complete": "yes", "lost /winding/rig/tension": "3"})
    assert check(tmp_path / "bag").findings == [
        "/winding/rig/tension: 3 messages never reached the recorder"
    ]
    (lost,) = (t.lost for t in contents(tmp_path / "bag").topics if t.name.endswith("tension"))
    assert lost == 3


def test_a_cut_file_gives_back_every_whole_chunk(bags: Any, tmp_path: Path) -> None:
    file = storage_file(bags.whole(tmp_path / "made", 150, chunk_bytes=40_000))
    whole, chunks = file.read_bytes(), bags.chunks(file)
    rng = random.Random(3)
    cut, out = tmp_path / "cut", tmp_path / "out"
    for _ in range(CUTS):
        length = rng.randrange(len(whole))
        cut.mkdir()
        (cut / "bag_0.mcap").write_bytes(whole[:length])
        expected = sum(messages for end, messages, _ in chunks if end <= length)
        before = bags.fingerprint(cut)
        if expected == 0:
            with pytest.raises(BagError, match="holds no whole chunk"):
                recover(cut, out)
        else:
            (salvage,) = recover(cut, out)
            assert salvage.kept == expected
            assert sum(bags.counts(out).values()) == expected
            shutil.rmtree(out)
        assert bags.fingerprint(cut) == before
        shutil.rmtree(cut)


def test_only_the_damaged_chunk_is_lost(bags: Any, copied: Path, tmp_path: Path) -> None:
    file = storage_file(copied)
    chunks = bags.chunks(file)
    end, inside, _ = chunks[3]
    flipped(file, end - 5000, 3)
    (salvage,) = recover(copied, tmp_path / "out")
    assert salvage.kept == sum(messages for _, messages, _ in chunks) - inside
    assert len(salvage.losses) == 1


def test_chunks_behind_a_broken_length_are_found(bags: Any, copied: Path, tmp_path: Path) -> None:
    file = storage_file(copied)
    with file.open("rb") as stream:
        index = make_reader(stream).get_summary().chunk_indexes[2]
    chunks = bags.chunks(file)
    flipped(file, index.chunk_start_offset + 4, 1)
    (salvage,) = recover(copied, tmp_path / "out")
    assert salvage.kept == sum(messages for _, messages, _ in chunks) - chunks[2][1]


def test_an_undamaged_recording_is_recovered_whole(bags: Any, made: Path, tmp_path: Path) -> None:
    (salvage,) = recover(made, tmp_path / "out")
    assert salvage.losses == []

    def content(folder: Path) -> list[tuple[str, int, bytes]]:
        with opened(folder) as reader:
            return [(c.topic, t, bytes(d)) for c, t, d in reader.messages()]

    assert content(tmp_path / "out") == content(made)


def test_nothing_is_written_over_an_existing_folder(made: Path, tmp_path: Path) -> None:
    with pytest.raises(BagError, match="never overwritten"):
        recover(made, tmp_path)


def test_a_folder_without_storage_is_no_recording(tmp_path: Path) -> None:
    for look in (check, contents, lambda path: recover(path, tmp_path / "out")):
        with pytest.raises(BagError, match="holds no"):
            look(tmp_path)
