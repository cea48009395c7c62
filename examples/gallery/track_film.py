"""Track a folder of pictures or a video, and draw the markers into its last frame."""

import sys
from pathlib import Path

import matplotlib.pyplot as plt

from marker_tracker_node import FrameSource, Tracker, TrackerConfig, read_camera, read_motion
from winding_core.cable.condition import Condition

camera, motion = read_camera(Path("film/camera.yaml")), read_motion(Path("film/motion.csv"))
tracker = Tracker(TrackerConfig.of(Condition(case=8).resolved()), camera)
for t, frame in FrameSource(Path(sys.argv[1])):
    markers = tracker.track(frame, t, *motion.at(t))
for n, x, y, z, theta in markers[["id", "x", "y", "z", "theta"]]:
    print(f"P{n}: {theta:.4f} rad behind P0, at ({x:.4f}, {y:.4f}, {z:.4f}) m in winder_axis")
plt.figure(figsize=(8.0, 1.6), layout="constrained").add_subplot().imshow(frame[..., ::-1])
plt.plot(*camera.pixels(markers[markers["flags"] == 0], tracker.pose).T, "ro", mfc="none", ms=20)
plt.savefig("track_film.png")
