"""Wind 21 cables, seven weights with three moduli, and draw where P4 comes to lie."""

import dataclasses

import matplotlib.pyplot as plt

from cable_fem_node.winding.prediction import predict
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.condition import Condition

weights = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5)
for mpa in (2, 3, 5):
    cable = Condition(case=4, marker_spacing=30e-3, young=1e6 * mpa)
    cases = [dataclasses.replace(cable, weight=weight).resolved().case for weight in weights]
    runs = [predict(WindingConfig(case=case), duration=6.0) for case in cases]
    plt.plot(weights, [1e3 * run.markers["s"][4] for run in runs], "o-", label=f"{mpa} MPa")
plt.gca().set(xlabel="weight, N", ylabel="length from P0 to P4, mm")
plt.legend(title="Young's modulus")
plt.savefig("sweep_weight.png")
