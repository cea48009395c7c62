"""Run the lay controller's node: python -m lay_control_node --ros-args ..."""

import sys

from lay_control_node.node import LayControlNode
from winding_ros.runtime.process import run_node


def main() -> int:
    """Entry point of the node's process."""
    return run_node(LayControlNode)


if __name__ == "__main__":
    sys.exit(main())
