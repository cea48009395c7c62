"""Wind 21 cables, seven weights with three moduli, and draw where P4 comes to lie."""

import matplotlib.pyplot as plt

import cable_winding as cw

weights = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5)
for mpa in (2, 3, 5):
    cable = {"case": 4, "marker_spacing": 30e-3, "young": 1e6 * mpa, "duration": 6.0}
    runs = [cw.predict(cw.Condition(**cable, weight=weight)) for weight in weights]
    plt.plot(weights, [1e3 * run.markers.s[4] for run in runs], "o-", label=f"{mpa} MPa")
plt.gca().set(xlabel="weight, N", ylabel="length from P0 to P4, mm")
plt.legend(title="Young's modulus")
plt.savefig("sweep_weight.png")
