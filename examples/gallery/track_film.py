"""Track a folder of images or a video, and draw the markers into its last frame."""

import sys

import matplotlib.pyplot as plt

import cable_winding as cw

files = {"camera": "film/camera.yaml", "motion": "film/motion.csv"}
found = cw.track(sys.argv[1], cw.Condition(case=8), **files)
markers = found.markers
for n, (x, y, z), theta in zip(markers.id, markers.xyz, markers.theta, strict=True):
    print(f"P{n}: {theta:.4f} rad behind P0, at ({x:.4f}, {y:.4f}, {z:.4f}) m in winder_axis")
axes = plt.figure(figsize=(8.0, 1.6), layout="constrained").add_subplot()
axes.imshow(found.frame[..., ::-1])
axes.plot(*found.pixels[markers.flags == 0].T, "ro", mfc="none", ms=20)
plt.savefig("track_film.png")
