"""Read a recording of `winding run --bag`, and draw three of its topics."""

import sys

import matplotlib.pyplot as plt

import cable_winding as cw

for topic in ("fem/markers", "tracker/markers", "correction/markers"):
    marker = cw.read_bag(sys.argv[1], topic)
    wound = (marker["id"] > 0) & (marker["flags"] & cw.MarkerFlag.NOT_WOUND == 0)
    n, t, s = (marker[name][wound] for name in ("id", "t", "s"))
    plt.plot(t, 1e3 * s, ".", ms=3, label=topic)
    print(f"{topic}: finally P{n[-1]} lies {1e3 * s[-1]:.2f} mm behind P0")
plt.gca().set(xlabel="simulated time, s", ylabel="length from P0, mm")
plt.legend()
plt.savefig("read_bag.png")
