"""Run the tracker's node: python -m marker_tracker_node --ros-args ..."""

import sys

from marker_tracker_node.node import MarkerTrackerNode
from winding_ros.process import run_node


def main() -> int:
    """Entry point of the node's process."""
    return run_node(MarkerTrackerNode)


if __name__ == "__main__":
    sys.exit(main())
