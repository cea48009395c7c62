"""Run the rig node: python -m winding_rig_node --ros-args ..."""

import sys

from cable_winding.ros.process import run_node
from winding_rig_node.node import RigNode

if __name__ == "__main__":
    sys.exit(run_node(RigNode))
