"""Run the correction's node: python -m correction_node --ros-args ..."""

import sys

from cable_winding.ros.process import run_node
from correction_node.node import CorrectionNode


def main() -> int:
    """Entry point of the node's process."""
    return run_node(CorrectionNode)


if __name__ == "__main__":
    sys.exit(main())
