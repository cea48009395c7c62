"""Wind a relaxing rubber under a tension law of your own, and draw its strain."""

import matplotlib.pyplot as plt

import cable_winding as cw


def brake(weight: float, cylinder_diameter: float, wound_length: float) -> float:
    return weight * (0.7 + 0.4 * wound_length)  # the reel empties and its brake pulls harder [N]


for prony in ("", "0.2:5"):  # a fifth of the stress relaxes with a time constant of 5 s
    cable = cw.Condition(case=4, law="mooney_rivlin", prony=prony)
    run = cw.predict(cable, tension_law=brake)
    plt.plot(1e3 * run.cable.s, 1e2 * run.cable.strain, label=f"prony: {prony or 'none'}")
plt.gca().set(xlabel="undeformed cable from P0, mm", ylabel="strain, %")
plt.legend()
plt.savefig("own_laws.png")
