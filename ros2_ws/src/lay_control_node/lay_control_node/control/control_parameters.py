"""Parameters of the controller, and the controller that follows from them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from lay_control_node.control.guide_law import GuideLaw, WantedLay
from lay_control_node.control.landing_law import LandingLaw, PullBounds
from lay_control_node.control.lay_controller import ControllerConfig, LayController
from lay_control_node.control.lay_filter import LayFilter, LayFilterConfig
from lay_control_node.control.layer_watch import LayerWatch
from lay_control_node.control.stretch_filter import StretchFilter, StretchFilterConfig
from lay_control_node.planning.lay_on import LayOnLaw
from winding_core.cable.condition import ResolvedCondition
from winding_core.lay.layers import HEIGHT_TOLERANCE, WoundDrum
from winding_core.lay.limits import GuideBounds
from winding_core.lay.records import ControlMode
from winding_core.lay.rounding import OF_FRICTION
from winding_core.machine.commanded_axis import MotionLimits
from winding_core.machine.commands import CARRIAGE
from winding_core.machine.tension import RigTension
from winding_core.parameters import parameter

# Multiple of the friction coefficient by which ln(pull) may change per radian (`PullBounds`).
_PULL_CHANGE = 1.4
_OF_PITCH = 0.25  # A measured height that is off by this part of the pitch may be another turn's
_LEAST_FRICTION = 0.02  # Cable that is held by less slips whatever the guide does


@dataclass(frozen=True, kw_only=True)
class ControlParameters(GuideBounds):
    """How the lay is controlled: priors of the estimates, and bounds of the commands."""

    control_gain: float = parameter(
        1.5,
        "rate at which an error of the lay is made up, per wound angle [1/rad]",
        low=0.1,
        high=5.0,
    )
    free_length_sigma: float = parameter(
        0.02, "prior standard deviation of the free length [m]", low=1.0e-4, high=1.0
    )
    eye_sigma: float = parameter(
        3.0e-4,
        "standard deviation of the cable's eye against the carriage [m]",
        low=1.0e-6,
        high=0.05,
    )
    guide_play: float = parameter(
        3.0e-4, "play of the cable's eye on the carriage [m]", low=0.0, high=0.05
    )
    load_share: float = parameter(
        0.7,
        "prior of the share of the pull at the guide that reaches the cylinder",
        low=0.05,
        high=2.0,
    )
    load_share_sigma: float = parameter(
        0.12, "standard deviation of that share", low=0.001, high=1.0
    )
    drag: float = parameter(
        0.15, "prior of the constant pull of the guide [N]", low=-2.0, high=10.0
    )
    drag_sigma: float = parameter(0.09, "standard deviation of that pull [N]", low=0.001, high=10.0)
    start_share: float = parameter(
        0.27, "prior of the share of the tension where the cable begins", low=0.0, high=1.5
    )
    start_share_sigma: float = parameter(
        0.06, "standard deviation of that share", low=0.001, high=1.0
    )
    build_up_length_sigma: float = parameter(
        0.075,
        "standard deviation of the wound length over which the tension builds up [m]",
        low=0.001,
        high=1.0,
    )
    following_error: float = parameter(
        0.02,
        "how far the setpoint goes ahead of a carriage that does not follow [m]",
        low=1.0e-3,
        high=1.0,
    )
    pull_range: list[float] = parameter(
        [0.3, 1.5], "smallest and largest pull, as shares of the weight", low=0.01, high=20.0
    )

    def controller(
        self,
        what: ResolvedCondition,
        wanted: WantedLay,
        *,
        markers: Mapping[int, float],
        mode: ControlMode,
        solver_patience: float = math.inf,
        wound: WoundDrum | None = None,
        brake: bool = False,
    ) -> LayController:
        """Return the controller of a condition.

        Args:
            what: What is wound.
            wanted: The lay that is wanted.
            markers: Wound angle at which a marker is wanted [rad], by marker; none without
                a brake.
            mode: What it begins in.
            solver_patience: Time without the solver before the drive programme is followed [s].
            wound: The drum as it is to be filled; None for a bare cylinder.
            brake: Whether a brake gives the pull that the program states where no marker is wanted.

        Raises:
            ValueError: Limits end before they begin, or the cable's stress fades.
        """
        case = what.case
        pitch = what.drive.pitch if wound is None else wound.pitch
        case.material.refuse_fading("the lay controller")
        law = LayOnLaw(
            case,
            what.material_law(
                case.material.young * case.material.axial_factor, case.material.poisson
            ),
        )
        radius = case.centreline_radius
        landing = None
        pulls = (self.pull_range[0] * case.weight, self.pull_range[1] * case.weight)
        if markers:
            landing = LandingLaw(
                law,
                spacing=case.marker_spacing,
                radius=radius,
                markers=markers,
                wanted=wanted,
                bounds=PullBounds(
                    low=pulls[0], high=pulls[1], per_radian=_PULL_CHANGE * what.friction
                ),
            )
        return LayController(
            config=ControllerConfig(
                advance_per_radian=what.drive.advance_per_radian,
                bending_stiffness=case.bending_stiffness,
                guide=MotionLimits(
                    name=CARRIAGE,
                    low=self.guide_travel[0],
                    high=self.guide_travel[1],
                    speed=self.guide_speed_limit,
                    acceleration=self.guide_acceleration_limit,
                ),
                following_error=self.following_error,
                height_tolerance=HEIGHT_TOLERANCE * case.cable_diameter,
                solver_patience=solver_patience,
                pulls=pulls if brake else None,
            ),
            wanted=wanted,
            law=GuideLaw(
                radius=radius,
                gain=self.control_gain,
                turning=OF_FRICTION * max(what.friction, _LEAST_FRICTION) * radius,
            ),
            lay=LayFilter(
                LayFilterConfig(
                    radius=radius,
                    free_length=what.free_length,
                    sigma_length=self.free_length_sigma,
                    sigma_offset=self.eye_sigma,
                    play=self.guide_play,
                    gate=_OF_PITCH * abs(pitch) or LayFilterConfig.gate,
                )
            ),
            stretch=StretchFilter(
                law,
                spacing=case.marker_spacing,
                radius=radius,
                config=StretchFilterConfig(
                    share=self.load_share,
                    sigma_share=self.load_share_sigma,
                    drag=self.drag,
                    sigma_drag=self.drag_sigma,
                    start=self.start_share,
                    sigma_start=self.start_share_sigma,
                    build_up=_build_up_length(what),
                    sigma_build_up=self.build_up_length_sigma,
                ),
            ),
            landing=landing,
            watch=None if wound is None else LayerWatch(wound),
            mode=mode,
        )


def _build_up_length(what: ResolvedCondition) -> float:
    law = what.tension_law
    return law.build_up_length if isinstance(law, RigTension) else RigTension().build_up_length
