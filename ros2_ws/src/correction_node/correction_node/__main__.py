"""Run the correction's node: python -m correction_node --ros-args ..."""

import sys

from correction_node.node import CorrectionNode
from winding_ros.runtime.process import run_node


def main() -> int:
    """Entry point of the node's process."""
    return run_node(CorrectionNode)


if __name__ == "__main__":
    sys.exit(main())
