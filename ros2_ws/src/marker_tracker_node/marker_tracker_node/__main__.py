"""Run the tracker's node: python -m marker_tracker_node --ros-args ..."""

import sys

from cable_winding.ros.process import run_node
from marker_tracker_node.node import MarkerTrackerNode


def main() -> int:
    """Entry point of the node's process."""
    return run_node(MarkerTrackerNode)


if __name__ == "__main__":
    sys.exit(main())
