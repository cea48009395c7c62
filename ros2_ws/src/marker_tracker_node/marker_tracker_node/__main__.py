"""Run the tracker: python -m marker_tracker_node [--camera SOURCE | --compressed] --ros-args ..."""

import sys

from marker_tracker_node.node import ComposedTrackerNode, MarkerTrackerNode
from winding_core.machine.camera_source import CameraSource, CameraSourceError
from winding_ros.graph import COMPRESSED_TRACKER
from winding_ros.runtime.process import EXIT_REFUSED, run_node


def main() -> int:
    """Entry point of the node's process, and of a camera in it: MODULE:FUNCTION or a file's."""
    if sys.argv[1:2] == ["--compressed"]:
        del sys.argv[1]
        return run_node(lambda: MarkerTrackerNode(COMPRESSED_TRACKER))
    if sys.argv[1:2] != ["--camera"]:
        return run_node(MarkerTrackerNode)
    try:
        source = CameraSource.parsed(sys.argv[2] if len(sys.argv) > 2 else "")
        camera = source.load()
    except CameraSourceError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_REFUSED
    del sys.argv[1:3]
    return run_node(lambda: ComposedTrackerNode(camera))


if __name__ == "__main__":
    sys.exit(main())
