"""Winding a whole run ahead of time: where every marker ends up and how much cable is used."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cable_fem_node.dynamics.state import (
    EnergyBalanceError,
    EnergyLedger,
    FloatArray,
    ImpossibleResultError,
)
from cable_fem_node.winding.validity import (
    FULL_TURN,
    Check,
    checks_of,
    guide_check,
    motion_check,
    overlap_check,
    refuse,
    refuse_past_the_start,
    rod_checks,
    tension_check,
)
from cable_fem_node.winding.winding_config import WindingConfig
from cable_fem_node.winding.winding_model import WindingModel
from winding_core.machine.drive import PAPER_DURATION, DriveProfile
from winding_core.markers import Markers
from winding_core.run_options import ELEMENTS

APART, TOUCHING, ON_CABLE = "apart", "touching", "on cable"
# In the distance of touching centre lines: springs between turns give way by half a per cent, and a
# node between two others stands higher by less than a tenth.
_CONTACT, _RAISED = 1.01, 0.1
_PLACES = 180  # Places in a turn at which it is compared with those before


def on_cable(radius: FloatArray, apart: float) -> NDArray[np.bool_]:
    """Return which nodes of wound cable stand out from those that lie on the cylinder, shape (n,).

    Args:
        radius: Distances from the axis [m], shape (n,).
        apart: Distance of touching centre lines [m].
    """
    return np.asarray(radius - radius.min(initial=np.inf) > _RAISED * apart)


def how_turns_lie(
    theta: FloatArray, z: FloatArray, radius: FloatArray, apart: float
) -> tuple[str, ...]:
    """Return how each complete turn lies, by its closest place.

    Args:
        theta: Wound angles of the cable's nodes from P0 on [rad], ascending, shape (n,).
        z: Axial positions [m], shape (n,).
        radius: Distances from the axis [m], shape (n,).
        apart: Distance of touching centre lines [m].

    Returns:
        APART, TOUCHING or ON_CABLE for each turn, the first one first.
    """
    turns = int(theta[-1] / math.tau)
    at = math.tau * np.arange(turns * _PLACES).reshape(turns, _PLACES) / _PLACES
    across, out = np.interp(at, theta, z), np.interp(at, theta, radius)
    # Where the cable begins, and where a node has just landed, it is held by others than these.
    raised = on_cable(out, apart).sum(axis=1) > 1
    found = []
    for turn in range(turns):
        way = np.hypot(across[:turn] - across[turn], out[:turn] - out[turn])
        touching = turn > 0 and float(way.min()) < _CONTACT * apart
        found.append(ON_CABLE if raised[turn] else TOUCHING if touching else APART)
    return tuple(found)


Progress = Callable[[float], None]
Look = Callable[[WindingModel], None]
Clock = Callable[[], float]

FRAME_RATE = 50.0  # Marker records per second of a run [1/s]

# Cable lies with the tension of the span that laid it, which may change by a rig's law.
_TIGHTER_PCT = 2.0
_SUSPECTS = "try shorter elements, less mass scaling, a steadier tension"

BALANCE_LIMIT_PCT = 1.0  # Energy that the ledger cannot explain, of what went in


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """Outcome of a run wound ahead."""

    config: WindingConfig  # What was wound
    drive: DriveProfile  # How the machine moved
    times: FloatArray  # Times of the history [s], shape (m,)
    history: NDArray[np.void]  # Marker records over time, shape (m, markers + 1)
    arc: FloatArray  # Reference length from P0 along the wound cable [m], shape (k,)
    theta: FloatArray  # Wound angle there [rad], shape (k,)
    z: FloatArray  # Axial position there [m], shape (k,)
    cable: NDArray[np.void]  # Nodes at the end: x y z s tension strain roll twist, shape (nodes,)
    energy: EnergyLedger  # Ledger at the end
    stretch: float  # Mean stretch of the wound cable
    stretch_closed_form: float  # The law's at the wound tension F - EI l / (2 rho^2), as it landed
    span_stretch: float  # The law's stretch at the span tension F
    cpu_seconds: float  # Processor time of the run [s]
    element_steps: int  # Elements times steps

    @property
    def markers(self) -> Markers:
        """Records of P0..Pn at the end of the run."""
        last: Markers = self.history[-1]
        return last

    @property
    def duration(self) -> float:
        """Simulated time [s]."""
        return float(self.times[-1])

    @property
    def cpu_s_per_sim_s(self) -> float:
        """Processor seconds per simulated second."""
        return self.cpu_seconds / self.duration

    @property
    def turns(self) -> int:
        """Complete turns of cable on the cylinder."""
        return int(self.theta[-1] / FULL_TURN)

    def marker_roll(self) -> FloatArray:
        """Return by what angle P0..Pn have turned about the cable's axis [rad], shape (n + 1,)."""
        return self._at_markers("roll")

    def marker_twist(self) -> FloatArray:
        """Return the twist of the cable at P0..Pn [rad/m], shape (n + 1,)."""
        return self._at_markers("twist")

    def _at_markers(self, name: str) -> FloatArray:
        place = self.config.case.marker_spacing * self.markers["id"]
        return np.asarray(np.interp(place, self.cable["s"], self.cable[name]))

    def cable_per_turn(self) -> FloatArray:
        """Return the reference length of cable in each complete turn [m], shape (turns,)."""
        bounds = FULL_TURN * np.arange(self.turns + 1)
        return np.diff(np.interp(bounds, self.theta, self.arc))

    def pitch_per_turn(self) -> FloatArray:
        """Return the axial advance of each complete turn [m], shape (turns,)."""
        return np.diff(self.z_at(FULL_TURN * np.arange(self.turns + 1)))

    def lies_per_turn(self) -> tuple[str, ...]:
        """Return how each complete turn lies, see `how_turns_lie`."""
        laid = self.cable[: self.theta.size]
        radius = np.hypot(laid["x"], laid["y"])
        return how_turns_lie(self.theta, self.z, radius, self.config.resolved.constants.touch.apart)

    def z_at(self, theta: ArrayLike) -> FloatArray:
        """Return z [m] of the laid cable at wound angles [rad] within the wound range."""
        return np.asarray(np.interp(np.asarray(theta, dtype=float), self.theta, self.z))


@dataclass(frozen=True, kw_only=True)
class PlannedRun:
    """One run of the solver, checked, not yet wound.

    Raises:
        ValueError: The cylinder turns back past the start, the duration is not positive, the
            element is unknown or has no stiffness factors.
    """

    config: WindingConfig  # The model
    # How the machine moves; the paper's motion by default.
    drive: DriveProfile = field(default_factory=DriveProfile)
    duration: float = PAPER_DURATION  # Time to wind [s]
    element: str = "rod"  # One of ELEMENTS

    def __post_init__(self) -> None:
        if self.element not in ELEMENTS:
            raise ValueError(f"element must be {' or '.join(ELEMENTS)}, got {self.element!r}")
        _refuse_unless_positive("duration", self.duration)
        if self.element == "solid":
            self.config.refuse_rod_material()
        refuse_past_the_start(self._angles())
        refuse(self.checks())

    def checks(self) -> tuple[Check, ...]:
        """Return what decides whether the result can be right."""
        resolved = self.config.resolved
        own = checks_of(resolved)
        if self.element == "rod":
            own = (*rod_checks(resolved), tension_check(resolved, self.drive))
        own = (*own, motion_check(resolved, self.drive))
        if self.config.drum is not None:
            own = (*own, guide_check(resolved, self.most_wound))
        if self.most_wound < FULL_TURN or self.config.drum is not None:
            return own
        solid = self.element == "solid"
        return (*own, overlap_check(resolved, self.drive, self.duration, solid=solid))

    @property
    def most_wound(self) -> float:
        """Largest angle that the cylinder reaches [rad]."""
        return float(self._angles().max())

    def _angles(self, t: float | None = None) -> FloatArray:
        times = np.linspace(0.0, self.duration if t is None else t, 2001)
        return np.asarray(self.drive.positions(times)[0])

    def refuse_impossible(
        self, theta: FloatArray, tension: FloatArray, t: float | None = None
    ) -> None:
        """Refuse cable that cannot lie so.

        Args:
            theta: Wound angles of the cable on the cylinder [rad], shape (k,).
            tension: Of its elements [N], shape (k - 1,).
            t: When [s]; the end of the run by default.

        Raises:
            ImpossibleResultError: It did not follow the cylinder, or is tighter than the span.
        """
        angles = self._angles(t)
        behind = left_behind(float(angles[-1]), float(theta[-1]))
        if behind:
            raise ImpossibleResultError(behind)
        law, case = self.config.tension_law, self.config.case
        arc = self.config.resolved.wound_radius * np.linspace(0.0, angles.max(), 200)
        highest = max(law(case.weight, case.cylinder_diameter, float(s)) for s in arc)
        # A section of the solid carries its bending in the same stress.
        rod = self.element == "rod" and tension.size > 0
        if rod and float(tension.mean()) > highest * (1.0 + 0.01 * _TIGHTER_PCT):
            raise ImpossibleResultError(
                f"the wound cable is tighter ({float(tension.mean()):.4g} N) than the span was at "
                f"most ({highest:.4g} N); take shorter elements or less mass scaling"
            )

    def frame_times(self, rate: float = FRAME_RATE) -> FloatArray:
        """Return the times [s] to which the model is advanced, from 0 to the end of the run."""
        frames = max(1, math.ceil(self.duration * rate - 1.0e-9))
        return np.asarray(self.duration * np.arange(frames + 1) / frames)

    def model(self) -> WindingModel:
        """Return the model at the start of the run, its machine code loaded or built."""
        model = _MODELS[self.element](self)
        model.compile()
        return model

    def refuse_wrong(self, model: WindingModel) -> None:
        """Refuse what a model has wound up to its time.

        Raises:
            EnergyBalanceError: The energy balance does not close within 1 %.
            ImpossibleResultError: The cable did not lie down, or is tighter than the span.
        """
        refuse_open_balance(model.energy, model.time, self.checks())
        _, theta, _ = model.wound_path()
        laid = model.cable()[: theta.size]
        apart = self.config.resolved.constants.touch.apart
        # Cable that is lifted by cable, or slides off it, lies on a longer way than it landed on.
        lifted = on_cable(np.hypot(laid["x"], laid["y"]), apart).any()
        tension = laid["tension"][1 : 1 if lifted else None]
        self.refuse_impossible(theta, tension, model.time)

    def wind(
        self,
        progress: Progress | None = None,
        *,
        rate: float = FRAME_RATE,
        whole: bool = True,
        look: Look = lambda _model: None,
        cpu_clock: Clock = time.process_time,
    ) -> Prediction:
        """Take the model along the machine's plan from start to finish.

        Args:
            progress: Called with the share done, 0..1.
            rate: Marker records per second [1/s].
            whole: Keep the records of all times; else of the end alone, after the same steps.
            look: Called with the model at every of these times, the start included.
            cpu_clock: Processor time [s], for the speed that is reported.

        Raises:
            DivergenceError: The integration failed.
            EnergyBalanceError: The energy balance does not close within 1 %.
            ImpossibleResultError: The cable did not lie down, or is tighter than the span.
            ValueError: The rate is not positive.
        """
        _refuse_unless_positive("rate", rate)
        model = self.model()
        times = self.frame_times(rate)
        frames = times.size - 1
        records = [model.markers()] if whole else []
        look(model)
        started = cpu_clock()
        for i, t in enumerate(times[1:].tolist(), start=1):
            model.advance_to(t, self.drive.reading_at(t))
            if whole or i == frames:
                records.append(model.markers())
            look(model)
            if progress is not None:
                progress(i / frames)
        cpu_seconds = cpu_clock() - started
        self.refuse_wrong(model)
        arc, theta, z = model.wound_path()
        span = model.span_tension
        return Prediction(
            config=self.config,
            drive=self.drive,
            times=times[-len(records) :],
            history=np.stack(records),
            arc=arc,
            theta=theta,
            z=z,
            cable=model.cable(),
            energy=model.energy,
            stretch=model.wound_stretch(),
            stretch_closed_form=self.config.resolved.wound_stretch(
                span, lambda: [self.drive.time_at_angle(x) for x in np.linspace(0.0, theta[-1], 50)]
            ),
            span_stretch=self.config.resolved.stretch_at(span),
            cpu_seconds=cpu_seconds,
            element_steps=model.element_steps,
        )


def predict(
    config: WindingConfig,
    drive: DriveProfile | None = None,
    duration: float = PAPER_DURATION,
    progress: Progress | None = None,
    *,
    element: str = "rod",
    rate: float = FRAME_RATE,
    cpu_clock: Clock = time.process_time,
) -> Prediction:
    """Wind a whole run ahead.

    Args:
        config: The model.
        drive: The machine's motion; the paper's by default.
        duration: Time to wind [s].
        progress: Called with the share done, 0..1.
        element: One of ELEMENTS.
        rate: Marker records per second [1/s].
        cpu_clock: Processor time [s], for the speed that is reported.

    Raises:
        ValueError: As `PlannedRun`.
        SolverError, ValueError: As `PlannedRun.wind`.
    """
    run = PlannedRun(
        config=config,
        drive=DriveProfile() if drive is None else drive,
        duration=duration,
        element=element,
    )
    return run.wind(progress, rate=rate, cpu_clock=cpu_clock)


# Kernels take their time to load, so an element's are imported where a model of it is made.
def _rod(run: PlannedRun) -> WindingModel:
    from cable_fem_node.winding.rod_winding import RodWinding  # noqa: PLC0415

    return RodWinding(run.config)


def _solid(run: PlannedRun) -> WindingModel:
    from cable_fem_node.winding.solid_winding import SolidWinding  # noqa: PLC0415

    return SolidWinding(run.config, float(run.most_wound))


_MODELS: dict[str, Callable[[PlannedRun], WindingModel]] = {"rod": _rod, "solid": _solid}


def _refuse_unless_positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} must be positive and finite, got {value}")


def left_behind(turned: float, laid: float) -> str:
    """Return why cable does not follow a cylinder; empty where it does.

    Args:
        turned: Angle by which the cylinder has turned [rad].
        laid: Angle of it on which the cable lies [rad].
    """
    if turned <= FULL_TURN or laid >= 0.5 * turned:
        return ""
    return (
        f"the cylinder turned by {turned:.4g} rad and the cable lies on {laid:.4g} rad of it: it "
        "does not follow the cylinder; take shorter elements or more tension"
    )


def refuse_open_balance(energy: EnergyLedger, t: float, checks: tuple[Check, ...] = ()) -> None:
    """Refuse results whose energy balance does not close.

    Args:
        energy: Ledger of the run.
        t: Time that it has reached [s].
        checks: Of the run; those that warn are named as suspects.

    Raises:
        EnergyBalanceError: More than 1 % of the energy is not accounted for.
    """
    if energy.balance_pct > BALANCE_LIMIT_PCT:
        raise EnergyBalanceError(
            f"energy balance open by {energy.balance_pct:.3g} % at t = {t:g} s "
            f"(limit {BALANCE_LIMIT_PCT:g} %), kinetic over internal energy "
            f"{energy.kinetic_over_internal:.2g}; "
            + ("; ".join(check.sentence for check in checks if check.warned) or _SUSPECTS)
        )
