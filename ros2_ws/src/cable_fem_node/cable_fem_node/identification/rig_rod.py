"""The rod along the motion of one rig: what it adds to the closed form where pulls slip."""

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray, SolverError
from cable_fem_node.identification.rig import MOONEY, Numbers
from cable_fem_node.identification.rig_lay import BEYOND, RigLay
from cable_fem_node.identification.tracked_run import IdentificationError
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.run_ahead import replay
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.markers import is_wound
from winding_core.run_inputs import Inputs

# An element lies on the cylinder at most so many times its length long, as in `rod_run`.
_LONGEST = 1.15


def rod_run(lay: RigLay, numbers: Numbers, coarser: float = 1.0) -> tuple[WindingConfig, Inputs]:
    """Return what the rod winds of one rig, and its motion with the tension at the cylinder.

    Args:
        lay: Closed form of the motion.
        numbers: Shape (1,) each; eye and camera are those of a rig without errors.
        coarser: Length of an element over that of a prediction, dimensionless.
    """
    config, inputs = lay.config, lay.inputs.copy()
    share, young = (float(numbers[name][0]) for name in ("law_share", "young"))
    case = config.case
    stress = lay.stress(numbers, inputs["cylinder_angle"])[0]
    inputs["tension"] = young * case.axial_area * stress
    material = dataclasses.replace(case.material, young=young)
    config = dataclasses.replace(
        config,
        case=dataclasses.replace(case, material=material),
        law=MOONEY[1] if share > 0.0 else config.law,
        mooney_ratio=share / (1.0 - share) if share > 0.0 else config.mooney_ratio,
        friction=float(numbers["friction"][0]),
        free_length=float(numbers["free_length"][0]),
    )
    # Elements lie on the cylinder stretched.
    longest = config.resolved.law.stretch_at(young * float(stress.max()))
    segment = coarser * lay.config.resolved.segment * min(1.0, _LONGEST / longest)
    return dataclasses.replace(config, segment_length=segment), inputs


def rod_places(
    lay: RigLay, numbers: Numbers, coarser: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Return (theta [rad], z [m]) of the rod's markers, nan for one that has not landed, (m,) each.

    Raises:
        SolverError, ValueError: The rod fails, or the material cannot carry the tension.
    """
    config, inputs = rod_run(lay, numbers, coarser)
    model = RodWinding(config)
    replay(inputs[inputs["cylinder_angle"] <= BEYOND * lay.end], model)
    markers = model.markers()[1:]
    landed = is_wound(markers)
    return np.where(landed, markers["theta"], np.nan), np.where(landed, markers["z"], np.nan)


def rod_excess(
    lay: RigLay, numbers: Numbers, used: NDArray[np.intp], coarser: float = 1.0
) -> FloatArray:
    """Return theta [rad] and z [m] of the rod less those of the closed form, shape (2 m,).

    Args:
        lay: Closed form of the run.
        numbers: Shape (1,) each.
        used: Index of each marker among P1, P2, ..., shape (m,).
        coarser: Length of an element over that of a prediction, dimensionless.

    Raises:
        IdentificationError: The rod fails, or one of the markers does not land.
    """
    # Where friction begins to hold is the rod's; eye and camera are exact.
    one, none = np.ones(1), np.zeros(1)
    plain = numbers | {"held": one, "eye": none, "camera_scale": none}
    try:
        found = np.array(rod_places(lay, plain, coarser))[:, used]
    except (SolverError, ValueError) as error:
        raise IdentificationError(f"the rod cannot wind the best rig: {error}") from error
    if not np.isfinite(found).all():
        raise IdentificationError("a used marker does not land on the rod of the best rig")
    closed = np.array(lay(plain, int(used[-1]) + 1))[:, 0, used]
    return np.asarray(found - closed).ravel()


@dataclass(frozen=True, kw_only=True)
class RodExcess:
    """What the rod adds to the closed form of a run near the best rig.

    Where pulls change, how far behind the landing friction holds is of first order in the length
    of the elements, and the closed form has it too large where cable comes back. So there the
    number `held` is a length of the rod's elements over those of a prediction.
    """

    value: FloatArray  # Theta [rad] and z [m], shape (2 m,)
    by_element: FloatArray  # By the length of the elements over those of a prediction, (2 m,)
    # Of other rigs of the posterior, less `value`, shape (j, 2 m): how far it holds.
    others: FloatArray

    def __call__(self, held: FloatArray) -> FloatArray:
        """Return it for elements as long as `held` of a prediction's, shape (n,), as (n, 2 m)."""
        return np.asarray(self.value + (held - 1.0)[:, None] * self.by_element)

    def covariances(self) -> tuple[FloatArray, FloatArray]:
        """Return the mean squares of what other rigs add to theta and to z, shape (m, m) each."""
        parts = np.hsplit(self.others, 2)
        theta, z = (part.T @ part / max(len(part), 1) for part in parts)
        return np.asarray(theta), np.asarray(z)
