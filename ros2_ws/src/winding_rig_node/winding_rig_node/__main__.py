"""Run the rig's node: python -m winding_rig_node --ros-args ..."""

import sys

from cable_winding.ros.process import run_node
from winding_rig_node.node import RigNode


def main() -> int:
    """Entry point of the node's process."""
    return run_node(RigNode)


if __name__ == "__main__":
    sys.exit(main())
