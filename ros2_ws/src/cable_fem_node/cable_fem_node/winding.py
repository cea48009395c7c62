"""The winding model's public names: configuration, live model, prediction."""

from cable_fem_node.energy import EnergyLedger
from cable_fem_node.failure import DivergenceError, EnergyBalanceError
from cable_fem_node.prediction import OverlapError, Prediction, predict
from cable_fem_node.rod_winding import NODE_DTYPE, RodWinding
from cable_fem_node.winding_config import WindingConfig
from cable_winding.tension import DeadWeight, RigTension, TensionLaw
from cable_winding.uniaxial import LAWS, NoEquilibriumError, UniaxialLaw

__all__ = [
    "LAWS",
    "NODE_DTYPE",
    "DeadWeight",
    "DivergenceError",
    "EnergyBalanceError",
    "EnergyLedger",
    "NoEquilibriumError",
    "OverlapError",
    "Prediction",
    "RigTension",
    "RodWinding",
    "TensionLaw",
    "UniaxialLaw",
    "WindingConfig",
    "predict",
]
