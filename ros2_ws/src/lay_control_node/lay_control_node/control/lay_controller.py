"""The controller of the lay: what has landed, what is wanted, and what is commanded for it."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from lay_control_node.control.guide_law import BoundedMotion, GuideLaw, WantedLay, WantedPoint
from lay_control_node.control.landing_law import LandingLaw
from lay_control_node.control.lay_filter import LayEstimate, LayFilter, Place
from lay_control_node.control.layer_watch import LayerWatch
from lay_control_node.control.stretch_filter import StretchEstimate, StretchFilter
from winding_core.lay.records import ControlBasis, ControlMode, LayFlag, LayRecords
from winding_core.machine.commanded_axis import MotionLimits
from winding_core.machine.readings import AxisReading
from winding_core.markers import Markers

_FRAMES = 20  # Frames without a flag that a marker is averaged over
# How far their angles may spread: so much [rad], or so many of their own deviations where these
# are larger. Of 20 frames of a marker that lies, one set in a hundred spreads further than 5.7.
_SPREAD = 8.0e-3
_DEVIATIONS = 5.7
# Part of the error that all frames of a marker have in common: [rad] and [m].
_COMMON_ANGLE = 1.0e-3
_COMMON_HEIGHT = 3.0e-5


@dataclass(frozen=True, kw_only=True)
class LandedMarker:
    """Where a marker lies."""

    number: int  # Of the marker
    theta: float  # Wound angle [rad]
    z: float  # Height [m]
    sigma_theta: float  # One standard deviation of theta [rad]
    sigma_z: float  # One standard deviation of z [m]


class LandedMarkers:
    """Averages tracked markers frame by frame, and yields each one once."""

    def __init__(self) -> None:
        self._frames: dict[int, list[list[float]]] = {}
        self._landed: set[int] = set()

    def take(self, markers: Markers) -> Iterator[LandedMarker]:
        """Take the markers of a frame; yield those that have landed with it, in order.

        A record with a number that is not finite is passed over.
        """
        for record in np.sort(markers[markers["flags"] == 0], order="id"):
            number = int(record["id"])
            if number == 0 or number in self._landed:
                continue
            frame = [float(record[n]) for n in ("theta", "z", "sigma_theta", "sigma_z")]
            if not all(map(math.isfinite, frame)):
                continue
            frames = self._frames.setdefault(number, [])
            frames.append(frame)
            if len(frames) < _FRAMES:
                continue
            theta, _, sigma, _ = np.array(frames).T
            if np.ptp(theta) > max(_SPREAD, _DEVIATIONS * float(np.median(sigma))):
                # It moves, or one of the frames is wrong: the oldest one is the first to go.
                frames.pop(0)
                continue
            self._landed.add(number)
            yield _mean(number, frames)


def _mean(number: int, frames: list[list[float]]) -> LandedMarker:
    theta, z, sigma_theta, sigma_z = np.mean(frames, axis=0)
    share = 1.0 / math.sqrt(len(frames))
    return LandedMarker(
        number=number,
        theta=float(theta),
        z=float(z),
        sigma_theta=math.hypot(float(sigma_theta) * share, _COMMON_ANGLE),
        sigma_z=math.hypot(float(sigma_z) * share, _COMMON_HEIGHT),
    )


UNWOUND = 0.2  # Cable that lies on less than this has nothing on the cylinder that could slip [rad]
_DOUBTS = 3.0  # Neighbours hold cable off its place by so many deviations at most
_LEAST_TENSION = 1.0e-3  # Least tension that a span is taken to carry [N]


@dataclass(frozen=True, kw_only=True)
class ControllerConfig:
    """How the controller goes on when a node is silent."""

    advance_per_radian: float  # Guide advance of the drive programme [m/rad]
    bending_stiffness: float  # EI of the cable [N m^2]
    guide: MotionLimits  # Of the carriage
    # Wound angle without a measured height after which the lay counts as unseen [rad].
    unseen_angle: float = 3.0 * math.pi
    # How far off its layer's height a place may be seen that counts [m].
    height_tolerance: float = 1.0e-3
    following_error: float = 0.02  # How far the setpoint goes ahead of the carriage [m]
    # Time without the solver after which the guide follows the drive programme [s]; infinite where
    # no solver is subscribed to.
    solver_patience: float = 1.0
    # Smallest and largest pull that is commanded where the program states one [N]; None for none.
    pulls: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class Setpoint:
    """What is commanded, or would be."""

    t: float  # When it holds [s]
    theta: float  # Wound angle then [rad]
    guide: float  # Carriage position [m]
    guide_speed: float  # Its rate [m/s]
    pull: float | None  # Pull of the brake [N]; None where none is commanded
    wanted_z: float  # Wanted height at the contact line [m]
    lay: LayEstimate  # Estimate of the lay there
    stretch: StretchEstimate  # Estimate of the tension at lay-on
    basis: ControlBasis  # What it rests on
    limited: bool  # Whether a bound of the guide held it back
    ahead: float  # How far the setpoint is ahead of the carriage [m]
    commanding: bool  # Whether it is to be commanded


@dataclass(kw_only=True)
class LayController:
    """Follows machine, markers and lay; computes where guide and brake have to be.

    A carriage that has been driven is not left standing beside a cylinder that winds: in the other
    modes it goes on at the drive programme's advance, and the pull stays as it is.
    """

    config: ControllerConfig  # Bounds and patience
    wanted: WantedLay  # The lay that is wanted
    law: GuideLaw  # Of the guide
    lay: LayFilter  # Estimate of the lay
    stretch: StretchFilter  # Estimate of the tension at lay-on
    # Law of the brake; None where there is none or no marker has a wanted angle.
    landing: LandingLaw | None = None
    watch: LayerWatch | None = None  # Finds what is wrong with layers; None on a bare cylinder
    mode: ControlMode = ControlMode.WATCH  # What is done with the result
    late: bool = False  # Whether commands leave too late for what has been measured to be fed back
    # Of measured heights, in standard deviations, the newest last.
    innovations: list[float] = field(default_factory=list)
    _landed: LandedMarkers = field(default_factory=LandedMarkers)
    _guide: BoundedMotion | None = None
    _pull: float | None = None
    _before: float | None = None
    _solver_heard: float | None = None
    _driven: bool = False

    def take_markers(self, markers: Markers) -> None:
        """Take the tracked markers of one frame."""
        for landed in self._landed.take(markers):
            # The tracker places markers on the bare cylinder; so does the law of the stretch.
            wanted = self.wanted.at(landed.theta)
            if wanted.doubt > 0.0:
                continue
            self._measure(wanted, landed.theta, landed.z, landed.sigma_z)
            self.stretch.land(landed.number, landed.theta, landed.sigma_theta)

    def take_lay(self, places: LayRecords) -> None:
        """Take measured places of the wound cable; only those ahead of the newest one count.

        A place counts where it was seen as high as cable is wanted there. One on the turn before is
        that turn's, taken for the next one, or cable that climbs: the filter does without it.
        """
        new = np.sort(places[places["theta"] > self.lay.measured_to], order="theta")
        for place in new:
            theta, z, sigma = (float(place[name]) for name in ("theta", "z", "sigma_z"))
            wanted = self.wanted.at(theta)
            if self.watch is not None:
                self.watch.see_height(theta, z, float(place["lift"]))
            lies = (place["flags"] & (LayFlag.OVERLAP | LayFlag.CLIMB)) == 0
            if wanted.raised > 0.0:
                lies = abs(place["lift"] - wanted.raised) < self.config.height_tolerance
            if lies:
                limit = _DOUBTS * wanted.doubt if wanted.doubt > 0.0 else math.inf
                if self.watch is None or not self.watch.is_turn_before(theta, z):
                    self._measure(wanted, theta, z, math.hypot(sigma, wanted.doubt), limit)
                if self.watch is not None:
                    self.watch.measure(theta, z, sigma)

    def take_solver(self, t: float) -> None:
        """Note that the solver has answered for a time [s]."""
        self._solver_heard = t

    def advance(self, t: float, reading: AxisReading, pull: float) -> Setpoint:
        """Take the machine's present state; return what is to be commanded for it.

        Args:
            t: Time of the reading [s].
            reading: Both axes, theta 0 where P0 lies on the contact line.
            pull: Pull at the guide [N].

        Raises:
            ValueError: The guide does not stand outside the wound cable.
        """
        theta = reading.cylinder_angle
        wanted = self.wanted.at(theta)
        self._follow(reading, pull, wanted)
        dt = 0.0 if self._before is None else t - self._before
        self._before = t
        driving = self.mode is ControlMode.DRIVE
        self._driven |= driving
        # What has not driven stands ready to take over without a step.
        if self._guide is None or not self._driven or dt <= 0.0:
            self._guide = BoundedMotion(
                self.config.guide, reading.carriage_position, reading.feed_speed
            )
            self._pull = pull
        basis = self._basis(t) if driving or not self._driven else ControlBasis.RAMP
        guide, lay = self._guide, self.lay.estimate()
        if self.watch is not None:
            self.watch.land(lay.theta, lay.z, lay.sigma_z)
        guide.wait_for(reading.carriage_position, self.config.following_error)
        if basis in (ControlBasis.RAMP, ControlBasis.LATE):
            guide.go(self.config.advance_per_radian * reading.angular_speed, max(dt, 1.0e-9))
        else:
            turned = reading.angular_speed * dt
            command = self.law.command(wanted, lay, guide.position, turned)
            rate = command.per_radian * reading.angular_speed
            guide.follow(command.position, rate, max(dt, 1.0e-9))
        return Setpoint(
            t=t,
            theta=theta,
            guide=guide.position,
            guide_speed=guide.speed,
            pull=self._commanded_pull(theta, wanted) if driving or not self._driven else None,
            wanted_z=wanted.z,
            lay=lay,
            stretch=self.stretch.estimate,
            basis=basis,
            limited=guide.limited,
            ahead=guide.position - reading.carriage_position,
            commanding=self._driven,
        )

    def _follow(self, reading: AxisReading, pull: float, wanted: WantedPoint) -> None:
        """Carry both estimates on to a reading, and to what is wanted there."""
        theta, guide = reading.cylinder_angle, reading.carriage_position
        bend, longer = self._bend_length(theta, pull), 0.0
        if reading.guide is not None:
            known = self.lay.config
            longer = reading.guide.free_length(known.radius) - known.free_length
        place = Place(theta, guide, bend, wanted.raised, longer)
        if self._before is None and theta > UNWOUND:
            self.lay.join(place, wanted.slope)
            self.stretch.join(theta)
        self.lay.advance(place)
        self.stretch.advance(theta, pull, wanted.slope)

    def _bend_length(self, theta: float, pull: float) -> float:
        """Return sqrt(EI / T) [m] of the span under a pull at the guide [N]."""
        tension = self.stretch.estimate.tension(pull, self.law.radius * max(theta, 0.0))
        return math.sqrt(self.config.bending_stiffness / max(float(tension), _LEAST_TENSION))

    def _measure(
        self, wanted: WantedPoint, theta: float, z: float, sigma: float, limit: float = math.inf
    ) -> None:
        held = 0.0
        # On upper layers the cable below may hold it as well, either way.
        if self.watch is not None and wanted.raised == 0.0:
            held = self.watch.held(theta, z, sigma)
        score = self.lay.measure(theta, z, sigma, limit, held)
        if score is not None:
            self.innovations = [*self.innovations[-99:], score]

    def _basis(self, t: float) -> ControlBasis:
        patience = self.config.solver_patience
        if math.isfinite(patience) and t - (self._solver_heard or 0.0) > patience:
            return ControlBasis.RAMP
        if self.late:
            return ControlBasis.LATE
        seen = self.lay.estimate().theta - self.lay.measured_to <= self.config.unseen_angle
        return ControlBasis.MEASURED if seen else ControlBasis.MODEL

    def _commanded_pull(self, theta: float, wanted: WantedPoint) -> float | None:
        if self.landing is None:
            pulls = self.config.pulls
            if pulls is None or math.isnan(wanted.pull):
                return None
            return min(max(wanted.pull, pulls[0]), pulls[1])
        if self._pull is None or not self.stretch.known:
            return None
        self._pull = self.landing.pull(
            self.stretch.progress(theta), self.stretch.estimate, self._pull, free=theta <= UNWOUND
        )
        return self._pull
