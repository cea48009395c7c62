"""Run the solver's node: python -m cable_fem_node --ros-args ..."""

import sys

from cable_fem_node.node import CableFemNode
from winding_ros.runtime.process import run_node


def main() -> int:
    """Entry point of the node's process."""
    return run_node(CableFemNode)


if __name__ == "__main__":
    sys.exit(main())
