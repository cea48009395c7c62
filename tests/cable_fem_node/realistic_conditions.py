"""Random windings as a works would wind them: ten kinds of cables on drums of 8 to 60 diameters."""

import math
from dataclasses import dataclass

import numpy as np

from winding_core.parameters import build
from winding_study.run_parameters import RunParameters

Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Kind:
    """What data sheets say of a kind of cable; moduli are EA and density mass over the full circle.

    Attributes:
        strain: That the cable is wound with, EA being linear.
        bending: Bending stiffness over that of a full bar of the same EA.
        flow: Stress at which a solid wire yields [Pa]; None where it does not.
    """

    diameter: Range  # [m]
    young: Range  # [Pa]
    density: Range  # [kg/m^3]
    strain: Range
    bending: Range = (1.0, 1.0)
    flow: Range | None = None
    law: str = "linear"


KINDS = {
    "hose": Kind(
        diameter=(5e-3, 25e-3), young=(2e6, 10e6), density=(700.0, 1300.0), strain=(0.01, 0.1),
        bending=(1.0, 1.6), law="neo_hookean",
    ),
    "tube": Kind(
        diameter=(3e-3, 12e-3), young=(20e6, 500e6), density=(500.0, 1000.0), strain=(3e-3, 0.03),
        bending=(1.0, 1.6),
    ),
    "power cable": Kind(
        diameter=(5e-3, 30e-3), young=(0.5e9, 3e9), density=(1300.0, 3000.0), strain=(1e-4, 1e-3),
        bending=(0.01, 0.05),
    ),
    "network cable": Kind(
        diameter=(4e-3, 9e-3), young=(1e9, 4e9), density=(1100.0, 1700.0), strain=(1e-4, 1e-3),
        bending=(0.01, 0.05),
    ),
    "coaxial": Kind(
        diameter=(1e-3, 11e-3), young=(1e9, 6e9), density=(1500.0, 3000.0), strain=(1e-4, 1e-3),
        bending=(0.01, 0.05),
    ),
    "wire rope": Kind(
        diameter=(2e-3, 30e-3), young=(30e9, 60e9), density=(4000.0, 5500.0), strain=(5e-4, 3e-3),
        bending=(3e-3, 0.03),
    ),
    "copper wire": Kind(
        diameter=(0.1e-3, 3e-3), young=(110e9, 125e9), density=(8900.0, 8950.0),
        strain=(1e-4, 4e-4), flow=(80e6, 200e6),
    ),
    "fibre": Kind(
        diameter=(0.2e-3, 0.9e-3), young=(2e9, 20e9), density=(1100.0, 1500.0), strain=(3e-4, 2e-3),
        bending=(0.1, 0.4),
    ),
    "thread": Kind(
        diameter=(0.1e-3, 1e-3), young=(1e9, 8e9), density=(700.0, 1100.0), strain=(1e-3, 0.01),
        bending=(3e-3, 0.05),
    ),
    "tow": Kind(
        diameter=(0.5e-3, 3e-3), young=(30e9, 150e9), density=(900.0, 1600.0), strain=(5e-5, 5e-4),
        bending=(1e-5, 1e-3),
    ),
}  # fmt: skip


def drawn(seed: int) -> tuple[str, RunParameters]:
    """Return the kind and the condition of a seed: three turns of an even lay.

    Raises:
        ParameterError: A value is outside the limits of the options.
    """
    rng = np.random.default_rng([17, seed])

    def spread(low: float, high: float) -> float:
        return math.exp(rng.uniform(math.log(low), math.log(high)))

    name = str(rng.choice(list(KINDS)))
    kind = KINDS[name]
    diameter, young = spread(*kind.diameter), spread(*kind.young)
    cylinder = min(max(diameter * spread(8.0, 60.0), 2.0e-3), 2.0)
    tension = young * spread(*kind.strain) * math.pi * diameter**2 / 4.0
    radius = 0.5 * (cylinder + diameter)
    omega = min(spread(0.05, 0.5) / radius, 20.0)
    ramp = rng.uniform(0.5, 2.0)
    values = {
        "case": 0,
        "cylinder_diameter": cylinder,
        "cable_diameter": diameter,
        "weight": tension,
        "young": young,
        "poisson": 0.3,
        "density": spread(*kind.density),
        "bending_factor": spread(*kind.bending),
        "yield_stress": spread(*kind.flow) if kind.flow else 0.0,
        "law": kind.law,
        "friction": rng.uniform(0.1, 0.4),
        "free_length": min(max(cylinder * rng.uniform(0.5, 3.0), 0.01), 2.0),
        "angular_speed": omega,
        "ramp_time": ramp,
        "feed_speed": min(rng.uniform(1.05, 2.0) * diameter * omega / math.tau, 0.5),
        "duration": max(0.1, 3.0 * math.tau / omega + 0.5 * ramp),
        "markers": 1,
        "marker_spacing": min(max(math.tau * radius, 1.0e-3), 10.0),
    }
    # Refuses what is outside the declared limits, as a command does.
    return name, build(RunParameters, values, owner="a draw")
