"""Read a recording of `winding run --bag`, and draw three of its topics."""

import sys
from pathlib import Path

import matplotlib.pyplot as plt

from winding_core.markers import MarkerFlag
from winding_recorder.bags.tables import topic_rows

for topic in ("fem/markers", "tracker/markers", "correction/markers"):
    points = [point for message in topic_rows(Path(sys.argv[1]), topic) for point in message]
    wound = [p for p in points if p["id"] and not p["flags"] & MarkerFlag.NOT_WOUND]
    plt.plot([p["t"] for p in wound], [1e3 * p["s"] for p in wound], ".", ms=3, label=topic)
    print(f"{topic}: at last P{wound[-1]['id']} lies {1e3 * wound[-1]['s']:.2f} mm behind P0")
plt.gca().set(xlabel="simulated time, s", ylabel="length from P0, mm")
plt.legend()
plt.savefig("read_bag.png")
