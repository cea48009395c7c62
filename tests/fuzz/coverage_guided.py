"""Fuzz recordings or the tracker's pictures for as long as one likes, guided by coverage.

Not part of the test suite. The tracker is compiled: its coverage does not guide. atheris has a
wheel for Python 3.11 on Linux:

    pip install atheris
    python tests/fuzz/coverage_guided.py bags -max_total_time=600
    python tests/fuzz/coverage_guided.py tracker -max_total_time=600

Further arguments are libFuzzer's. What it finds is left as `crash-*` in the working directory.
"""

import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["winding_recorder", "mcap", "rosbags"]):
    import numpy as np
    from mcap.writer import Writer

    from marker_tracker_node import PinholeCamera, Tracker, TrackerConfig
    from winding_core.cases import paper_case
    from winding_core.markers import MarkerFlag
    from winding_recorder.bags.check import check
    from winding_recorder.bags.contents import contents
    from winding_recorder.bags.description import BagError
    from winding_recorder.bags.recover import recover

ROWS, COLUMNS = 32, 48
CASE = paper_case(4)
SCRATCH = Path(tempfile.mkdtemp(prefix="coverage-guided-"))


def read_recording(data: bytes) -> None:
    """Check and recover bytes as the storage file that their first byte chooses."""
    file = SCRATCH / ("bag_0.db3" if data[:1] == b"S" else "bag_0.mcap")
    file.write_bytes(data)
    out = SCRATCH / "out"
    for action in (lambda: check(file), lambda: contents(file), lambda: recover(file, out)):
        try:
            action()
        except BagError:
            continue
        finally:
            for left in out.glob("*"):
                left.unlink()
            if out.exists():
                out.rmdir()


def track(data: bytes) -> None:
    """Show the tracker pictures made of bytes, with an encoder made of bytes."""
    provider = atheris.FuzzedDataProvider(data)
    camera = PinholeCamera.from_info(
        width=COLUMNS,
        height=ROWS,
        k=[40.0, 0.0, COLUMNS / 2, 0.0, 40.0, ROWS / 2, 0.0, 0.0, 1.0],
        d=[],
    )
    config = TrackerConfig(
        cylinder_radius=CASE.cylinder_radius,
        cable_radius=CASE.cable_radius,
        marker_spacing=CASE.marker_spacing,
    )
    tracker = Tracker(config, camera)
    for k in range(provider.ConsumeIntInRange(1, 6)):
        angle = None if provider.ConsumeBool() else provider.ConsumeRegularFloat()
        colours = np.frombuffer(provider.ConsumeBytes(96).ljust(96, b"\x80"), dtype=np.uint8)
        # Patches of 8 x 6 pixels: one colour is larger than a marker.
        frame = np.kron(colours.reshape(4, 8, 3), np.ones((8, 6, 1), dtype=np.uint8))
        markers = tracker.track(frame, 0.005 * k, angle, provider.ConsumeRegularFloat())
        wound = (markers["flags"] & MarkerFlag.NOT_WOUND) == 0
        for name in ("theta", "z", "sigma_theta", "sigma_z"):
            if not np.isfinite(markers[name][wound]).all():
                raise AssertionError(f"{name} of a wound marker is not finite: {markers}")


def seed_corpus(folder: Path) -> None:
    """Write a small whole recording to begin with."""
    with (folder / "small.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/Header", "ros2msg", b"uint32 x")
        channel = writer.register_channel("/a", "cdr", schema)
        writer.add_message(channel, 1, bytes(12), 1)
        writer.finish()


def main() -> None:
    targets = {"bags": read_recording, "tracker": track}
    if len(sys.argv) < 2 or sys.argv[1] not in targets:
        raise SystemExit(f"name one of {', '.join(targets)}")
    arguments = [sys.argv[0], *sys.argv[2:]]
    if sys.argv[1] == "bags":
        corpus = SCRATCH / "corpus"
        corpus.mkdir()
        seed_corpus(corpus)
        arguments.append(str(corpus))
    atheris.Setup(arguments, targets[sys.argv[1]])
    atheris.Fuzz()


if __name__ == "__main__":
    main()
