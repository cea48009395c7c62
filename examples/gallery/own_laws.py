"""Wind under a tension law of your own a rubber whose stress fades, and draw its strain."""

import matplotlib.pyplot as plt

from cable_fem_node.winding.prediction import predict
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.condition import Condition


def brake(weight: float, cylinder_diameter: float, wound_length: float) -> float:
    return weight * (0.7 + 0.4 * wound_length)  # the reel empties and its brake pulls harder [N]


for fading in ("", "0.2:5"):  # a fifth of the stress, with a time constant of 5 s
    cable = Condition(case=4, prony=fading).resolved().case
    run = predict(WindingConfig(case=cable, law="mooney_rivlin", tension_law=brake))
    plt.plot(1e3 * run.cable["s"], 1e2 * run.cable["strain"], label=f"prony: {fading or 'none'}")
plt.gca().set(xlabel="undeformed cable from P0, mm", ylabel="strain, %")
plt.legend()
plt.savefig("own_laws.png")
