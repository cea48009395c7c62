"""Publish joint states at 1 kHz, commands at 500 Hz and frames at 200 Hz; print how many."""

import json
import sys
import time
from dataclasses import replace

import numpy as np
import rclpy
from made_bags import READING
from rclpy.node import Node

from winding_ros import topics
from winding_ros.messages.camera import encode_image
from winding_ros.messages.rig import encode_joint_state

WORST_BURST = 0.25


def main() -> None:
    seconds = float(sys.argv[1])
    rclpy.init()
    node = Node("load")
    # The graph declares commands at 50 Hz; history is rate times the worst stall.
    fast_commands = replace(topics.JOINT_COMMANDS, rate=500.0, depth=1000)
    joints, commands, images = (
        topic.advertise(node) for topic in (topics.JOINT_STATES, fast_commands, topics.IMAGE)
    )
    while not all(p.get_subscription_count() for p in (joints, commands, images)):
        time.sleep(0.01)
    frame = np.random.default_rng(2).integers(0, 256, (96, 640, 3), dtype=np.uint8)
    sent = {"rig/joint_states": 0, "rig/joint_commands": 0, "camera/image_raw": 0}
    begin = time.monotonic()
    for sample in range(int(seconds * 1000)):
        t = sample * 1e-3
        # A late wake-up is made up for by a burst, but never of more than flow control lets the
        # rig run ahead: on a starved machine time stands still instead.
        late = time.monotonic() - begin - t
        begin += max(0.0, late - WORST_BURST)
        time.sleep(max(0.0, -late))
        joints.publish(encode_joint_state(t, READING))
        sent["rig/joint_states"] += 1
        if sample % 2 == 0:
            commands.publish(encode_joint_state(t, READING))
            sent["rig/joint_commands"] += 1
        if sample % 5 == 0:
            images.publish(encode_image(t, frame))
            sent["camera/image_raw"] += 1
    sent["wall"] = time.monotonic() - begin
    print(json.dumps(sent), flush=True)
    # Reliable publishers that leave take their history with them.
    sys.stdin.readline()
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
