"""Run the solver's node: python -m cable_fem_node --ros-args ..."""

import sys

from cable_winding.ros.process import run_node

from cable_fem_node.node import CableFemNode

if __name__ == "__main__":
    sys.exit(run_node(CableFemNode))
