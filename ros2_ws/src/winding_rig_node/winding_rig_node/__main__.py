"""Run the rig's node: python -m winding_rig_node --ros-args ..."""

import sys

from winding_rig_node.node import RigNode
from winding_ros.runtime.process import run_node


def main() -> int:
    """Entry point of the node's process."""
    return run_node(RigNode)


if __name__ == "__main__":
    sys.exit(main())
