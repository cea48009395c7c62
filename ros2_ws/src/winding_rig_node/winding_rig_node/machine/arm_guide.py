"""The guide on a six-axis arm in place of the carriage: a servo for every joint."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from winding_core.arm.joint import SPEED_SHARE, ArmError
from winding_core.machine.readings import GuidePlace
from winding_rig_node.machine.axis import (
    AxisConfig,
    AxisState,
    EncoderConfig,
    EncoderState,
    MotorConfig,
    MotorState,
    advance_axis,
    control_axis,
    modelled_speed,
    read_encoder,
    tuned_pid,
)

if TYPE_CHECKING:
    from winding_core.arm.arm_path import ArmPath

FloatArray = NDArray[np.float64]

# A joint behind a gear of 1:100, everything reduced to its output.
_MOTOR = MotorConfig(
    supply=48.0,
    resistance=1.5,
    torque_constant=10.0,
    back_emf=10.0,
    inertia=1.5,
    viscous=5.0,
    coulomb=3.0,
    brake=150.0,
    ripple=0.05,
    ripple_period=2.0 * math.pi / 600.0,
)
_JOINT = AxisConfig(
    motor=_MOTOR,
    # An absolute encoder of 19 bits behind the gear.
    encoder=EncoderConfig(resolution=2.0 * math.pi / 2**19, bandwidth=40.0),
    pid=tuned_pid(_MOTOR, 12.0),
)
_POSITION_GAIN = 20.0  # Speed that a joint is given per way behind its plan [1/s]
# A plan is exact to this [m]: what is left of a step would be a step of the next speed.
_EXACT = 1.0e-10
# Joints so near to a place know the eye from there to half its square, in metres [rad].
_LINEAR = 1.0e-3
_SLOWED = 0.98  # A guide this much slower than it was asked to be is reported
# What the joints' encoders tell of the eye is as fine as this [m].
EYE_ENCODER = EncoderConfig(resolution=1.0e-6)


@dataclass(kw_only=True)
class ArmState:
    """Everything that changes on the arm."""

    joints: list[AxisState]  # Motor, encoder and servo of each
    planned: FloatArray  # Setpoints [rad or m], shape (joints,)
    speeds: FloatArray  # Their rates [rad/s or m/s], shape (joints,)
    about: FloatArray  # Joint positions about which the eye's place is linear [rad or m], alike
    eye: FloatArray  # Its place there in `winder_axis` [m], shape (3,)
    slopes: FloatArray  # How it moves with the joints there, shape (3, joints)
    place: GuidePlace  # Where it stands across the axis, as measured
    true_place: GuidePlace  # Where it truly does
    along: float = 0.0  # Setpoint of the eye along the axis [m]
    remark: str = ""  # Why the guide is slower than it was asked to be; else empty


class ArmGuide:
    """Moves the eye as the carriage is asked to move; the eye's way along the axis is its axis.

    The arm's controller makes up for the weight of its links and for the pull of the cable.
    """

    def __init__(self, path: ArmPath) -> None:
        self.path = path
        self.names = tuple(joint.name for joint in path.arm.joints)
        self._fastest = SPEED_SHARE * np.array([joint.speed for joint in path.arm.joints])

    def at_start(self) -> ArmState:
        """Return the arm at rest with the eye beside P0."""
        joints = [
            AxisState(
                motor=MotorState(position=position),
                encoder=EncoderState(position=position, tracked=position),
            )
            for position in self.path.start.tolist()
        ]
        start = self.path.start
        eye = self.path.eye(start)
        place = GuidePlace(x=float(eye[0]), y=float(eye[1]))
        return ArmState(
            joints=joints,
            planned=start,
            speeds=np.zeros(len(joints)),
            about=start,
            eye=eye,
            slopes=self.path.slopes(start),
            place=place,
            true_place=place,
        )

    def control(
        self,
        state: ArmState,
        eye: AxisState,
        *,
        setpoint: float,
        acceleration: float,
        dt: float,
        open_loop: bool,
    ) -> None:
        """Set the joints' voltages for a speed of the eye; see `control_axis`."""
        state.remark = ""
        along, planned = self._planned(state, setpoint, dt)
        shares = np.abs(planned - state.planned) / (dt * self._fastest)
        worst = int(shares.argmax())
        if shares[worst] > 1.0:
            wanted, setpoint, acceleration = setpoint, setpoint / float(shares[worst]), 0.0
            along, planned = self._planned(state, setpoint, dt)
            if not state.remark and abs(setpoint) < _SLOWED * abs(wanted):
                joint = self.path.arm.joints[worst]
                state.remark = (
                    f"the guide is slowed to {abs(setpoint):.3g} m/s at {along:.4g} m: "
                    f"{joint.name} would exceed its largest speed of {joint.speed:.3g}, as near a "
                    "singularity"
                )
        if along == state.along:
            setpoint = acceleration = 0.0
        speeds = (planned - state.planned) / dt
        rates = ((speeds - state.speeds) / dt).tolist()
        state.planned, state.speeds, state.along = planned, speeds, along
        eye.setpoint, eye.acceleration = setpoint, acceleration
        for axis, wanted, speed, rate in zip(
            state.joints, planned.tolist(), speeds.tolist(), rates, strict=True
        ):
            behind = wanted - axis.encoder.position
            # Within a count a joint that is to stand is left to its friction.
            if open_loop or (speed == 0.0 and abs(behind) <= _JOINT.encoder.resolution):
                behind = 0.0
            control_axis(
                _JOINT,
                axis,
                setpoint=speed + _POSITION_GAIN * behind,
                acceleration=rate,
                dt=dt,
                open_loop=open_loop,
            )

    def advance(
        self,
        state: ArmState,
        eye: AxisState,
        *,
        dt: float,
        braked: bool,
        seen: Callable[[float], float | None],
    ) -> None:
        """Move the joints by one sample period, and the eye with them; see `advance_axis`."""
        for axis in state.joints:
            advance_axis(_JOINT, axis, load=0.0, dt=dt, braked=braked)
        x, y, along = self._eye(state, _positions(state, "motor"))
        state.true_place = GuidePlace(x=x, y=y)
        moving = any(axis.motor.speed for axis in state.joints)
        eye.motor.speed = (along - eye.motor.position) / dt if moving else 0.0
        eye.motor.position = along
        x, y, measured = self._eye(state, self.measured(state))
        state.place = GuidePlace(x=x, y=y)
        read_encoder(
            EYE_ENCODER,
            eye.encoder,
            seen(measured),
            dt,
            acceleration=0.0 if braked else eye.acceleration,
        )

    def measured(self, state: ArmState) -> FloatArray:
        """Return the joints' positions by their encoders [rad or m], shape (joints,)."""
        return _positions(state, "encoder")

    def modelled_speed(self, state: ArmState) -> float:
        """Return the speed of the eye [m/s] that the joints' voltages stand for."""
        speeds = np.array([modelled_speed(_JOINT, axis, load=0.0) for axis in state.joints])
        return float(state.slopes[2] @ speeds)

    def _planned(self, state: ArmState, speed: float, dt: float) -> tuple[float, FloatArray]:
        """Return the place [m] and the joints [rad or m] after dt [s] at a speed [m/s]."""
        along = state.along + dt * speed
        if along == state.along:
            return along, state.planned
        try:
            ahead = state.planned + dt * state.speeds
            return along, self.path.joints_at(along, ahead, _EXACT)
        except ArmError as error:
            state.remark = f"the guide stands at {state.along:.4g} m: {error}"
            return state.along, state.planned

    def _eye(self, state: ArmState, joints: FloatArray) -> list[float]:
        """Return x, y and z of the eye at joint positions [m]."""
        off = joints - state.about
        if np.abs(off).max() > _LINEAR:
            state.about, off = joints, np.zeros_like(joints)
            state.eye, state.slopes = self.path.eye(joints), self.path.slopes(joints)
        place: list[float] = (state.eye + state.slopes @ off).tolist()
        return place


def _positions(state: ArmState, part: str) -> FloatArray:
    return np.array([getattr(axis, part).position for axis in state.joints])
