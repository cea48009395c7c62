"""Predict how a cable of your own lies on the cylinder, and draw it."""

import matplotlib.pyplot as plt

from cable_fem_node.winding.prediction import predict
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import Case

case = Case(cylinder_diameter=40e-3, cable_diameter=3e-3, weight=2.0, marker_spacing=120e-3)
run = predict(WindingConfig(case=case), duration=20.0)
for marker in run.markers[1:]:
    print(f"P{marker['id']} lies {1e3 * marker['s']:.1f} mm behind P0")
near = run.cable[run.cable["y"] > -40e-3]  # the span to the guide is longer than the cylinder
axes = plt.figure(layout="constrained").add_subplot(projection="3d", elev=20, azim=-70)
axes.plot(*(1e3 * near[axis] for axis in "zxy"), linewidth=3)
axes.plot(*(1e3 * run.markers[axis] for axis in "zxy"), "o", color="goldenrod")
axes.set(xlabel="z, mm", ylabel="x, mm", zlabel="y, mm", aspect="equal")
plt.savefig("predict_lay.png")
