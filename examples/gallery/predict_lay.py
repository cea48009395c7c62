"""Predict how a cable of your own lies on the cylinder, and draw it."""

import matplotlib.pyplot as plt

import cable_winding as cw

cable = cw.Condition(
    case=0, cylinder_diameter=40e-3, cable_diameter=3e-3, weight=2.0, marker_spacing=120e-3
)
run = cw.predict(cable)
for n, s in zip(run.markers.id[1:], run.markers.s[1:], strict=True):
    print(f"P{n} lies {1e3 * s:.1f} mm behind P0")
near = run.cable.xyz[run.cable.xyz[:, 1] > -40e-3]  # the span to the guide exceeds the cylinder
axes = plt.figure(layout="constrained").add_subplot(projection="3d", elev=20, azim=-70)
axes.plot(*(1e3 * near.T[[2, 0, 1]]), linewidth=3)
axes.plot(*(1e3 * run.markers.xyz.T[[2, 0, 1]]), "o", color="goldenrod")
axes.set(xlabel="z, mm", ylabel="x, mm", zlabel="y, mm", aspect="equal")
plt.savefig("predict_lay.png")
