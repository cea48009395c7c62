"""The drum as options: flanges, grooves, and the turns that fill it between them."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import Case
from winding_core.lay.layers import FULL_TURN, ROUNDING, WINDINGS, Layer, WoundDrum, layer_rise
from winding_core.machine.drum import START_SIDES, Drum, DrumError
from winding_core.parameters import ParameterError, Spelling, parameter, typed_record
from winding_core.units import LENGTH, LONG_LENGTH, MILLIMETRE, PLAIN, TURNS

Array = NDArray[np.float64]

MOST_TURNS = 10_000  # An hour at full speed is less


@dataclass(frozen=True, kw_only=True)
class DrumWinding:
    """How turns and layers follow each other.

    `orthocyclic`: each turn lies parallel to the flange and crosses to its next place within a
    share of the turn; layers lie in the valleys of those below. `parallel`: a helix that rests at
    the flange while it climbs, in valleys as well. `cross`: such a helix, whose layers cross those
    below.
    """

    winding: str = "orthocyclic"  # One of WINDINGS.
    # Between neighbours of a layer [m]; None for that of the grooves, or else the diameter.
    pitch: float | None = None
    crossing_share: float = 0.25  # Share of a turn in which an orthocyclic one crosses.
    edge_dwell: float = math.pi  # Angle for which a helix rests at a flange [rad].

    def __post_init__(self) -> None:
        if self.winding not in WINDINGS:
            raise DrumError(
                f"the winding must be one of {', '.join(WINDINGS)}, got {self.winding!r}"
            )
        if not 0.0 < self.crossing_share < 1.0:
            raise DrumError(
                f"the share of a turn that crosses must lie between 0 and 1, "
                f"got {self.crossing_share:g}"
            )
        if not 0.0 <= self.edge_dwell <= FULL_TURN:
            raise DrumError(
                "the dwell at the edge must lie in 0 to 1 turn, after which the cable would climb "
                f"on itself, got {self.edge_dwell / FULL_TURN:g}"
            )

    def wind(
        self,
        drum: Drum,
        cable_diameter: float,
        *,
        layers: int | None = None,
        length: float | None = None,
    ) -> WoundDrum:
        """Return the drum with whole layers or a length of cable on it.

        Args:
            drum: What is filled.
            cable_diameter: [m]
            layers: Count of layers; None where a length is given.
            length: Of cable on the drum [m]; None where the layers do.

        Raises:
            DrumError: Neither or both are given, or the cable would leave the drum.
        """
        if (layers is None) == (length is None):
            raise DrumError("say once how much goes on the drum: layers or a length")
        if layers is not None and layers < 1:
            raise DrumError(f"layers must be at least 1, got {layers}")
        if length is not None and not (math.isfinite(length) and length > 0.0):
            raise DrumError(f"the length must be positive and finite, got {length:g} m")
        pitch = self._pitch(drum, cable_diameter)
        rise = layer_rise(self.winding, cable_diameter, pitch)
        room = drum.width - cable_diameter
        if room < pitch * (1.0 - ROUNDING):
            raise DrumError(
                f"between flanges {drum.width / MILLIMETRE:.4g} mm apart there is no room for two "
                f"turns at a pitch of {pitch / MILLIMETRE:.4g} mm of a cable of "
                f"{cable_diameter / MILLIMETRE:.4g} mm: they need "
                f"{(pitch + cable_diameter) / MILLIMETRE:.4g} mm"
            )
        over = (drum.flange_height - cable_diameter) / rise
        most = math.floor(over + ROUNDING) + 1
        if most < 1:
            raise DrumError(
                f"flanges {drum.flange_height / MILLIMETRE:.4g} mm high hold no layer of a cable "
                f"of {cable_diameter / MILLIMETRE:.4g} mm"
            )
        whole = most if layers is None else layers
        path = self._path(drum, (cable_diameter, pitch, rise), min(whole, most), length)
        if whole > most or (length is not None and path.length < length * (1.0 - ROUNDING)):
            asked = f"{whole} layers" if length is None else f"{length:.4g} m of cable"
            needed = whole if length is None else most + 1
            height = ((needed - 1) * rise + cable_diameter) / MILLIMETRE
            raise DrumError(
                f"{asked} would pass the flanges, {drum.flange_height / MILLIMETRE:.4g} mm high: "
                f"they hold {most} layers, {path.length:.4g} m; {needed} layers need "
                f"{height:.4g} mm"
            )
        return path

    def _pitch(self, drum: Drum, cable_diameter: float) -> float:
        groove = drum.groove_pitch
        pitch = self.pitch if self.pitch is not None else groove or cable_diameter
        if groove is not None and abs(pitch - groove) > ROUNDING * groove:
            raise DrumError(
                f"a pitch of {pitch / MILLIMETRE:.4g} mm leaves the drum's grooves, which have one "
                f"of {groove / MILLIMETRE:.4g} mm: leave out the pitch, or the grooves"
            )
        return pitch

    def _path(
        self, drum: Drum, sizes: tuple[float, float, float], count: int, length: float | None
    ) -> WoundDrum:
        """Return the path through whole layers, or to a length [m] if they reach it."""
        diameter, pitch, rise = sizes
        first = drum.radius + 0.5 * diameter
        theta, z, layer, radii = [np.zeros(1)], [np.zeros(1)], [np.zeros(1, dtype=np.intp)], []
        begun, done = 0.0, 0.0
        for k in range(count):
            radii.append(first + k * rise)
            angle, place = self._layer(k, drum.width - diameter, pitch, last=k == count - 1)
            if begun + angle[-1] > MOST_TURNS * FULL_TURN:
                raise DrumError(
                    f"a drum takes at most {MOST_TURNS} turns, layer {k + 1} would pass them: wind "
                    "fewer layers or a wider pitch"
                )
            steps = np.hypot(radii[k] * np.diff(angle), np.diff(place))
            if length is not None and done + steps.sum() >= length:
                way = np.concatenate([[0.0], np.cumsum(steps)])
                end = float(np.interp(length - done, way, angle))
                place = np.append(place[angle < end - ROUNDING], np.interp(end, angle, place))
                angle = np.append(angle[angle < end - ROUNDING], end)
                steps = np.hypot(radii[k] * np.diff(angle), np.diff(place))
            theta.append(begun + angle[1:])
            # A negative zero would show as one.
            z.append(drum.sign * place[1:] + 0.0)
            layer[-1][-1] = k
            layer.append(np.full(angle.size - 1, k))
            begun, done = begun + float(angle[-1]), done + float(steps.sum())
            if length is not None and done >= length * (1.0 - ROUNDING):
                break
        wound = WoundDrum(
            drum=drum,
            cable_diameter=diameter,
            winding=self.winding,
            pitch=pitch,
            layers=(),
            theta=np.concatenate(theta),
            z=np.concatenate(z),
            layer=np.concatenate(layer),
        )
        return replace(wound, layers=tuple(_layers(wound, radii)))

    def _layer(self, k: int, room: float, pitch: float, *, last: bool) -> tuple[Array, Array]:
        """Return angles [rad] and distances from P0 [m] of layer k, and of the change after it."""
        if self.winding == "orthocyclic":
            return self._turns_of(k, room, pitch, last=last)
        angle = [0.0, FULL_TURN * room / pitch]
        place = [0.0, room] if k % 2 == 0 else [room, 0.0]
        if self.edge_dwell > ROUNDING and not last:
            angle.append(angle[-1] + self.edge_dwell)
            place.append(place[-1])
        return np.array(angle), np.array(place)

    def _turns_of(self, k: int, room: float, pitch: float, *, last: bool) -> tuple[Array, Array]:
        """Return the points of an orthocyclic layer: turns at rest, and what crosses between."""
        count = math.floor(room / pitch + ROUNDING) + 1
        far = (count - 1) * pitch
        # Where half a pitch is left at the far flange, the layers of the valleys are as wide.
        valley = far + (0.5 if far + 0.5 * pitch <= room * (1.0 + ROUNDING) else -0.5) * pitch
        even = pitch * np.arange(count)
        odd = np.arange(round(valley / pitch + 0.5))[::-1] * pitch + 0.5 * pitch
        places, after = (even, odd[0]) if k % 2 == 0 else (odd, 0.0)
        begin = FULL_TURN * np.arange(places.size)
        rests = begin + FULL_TURN * (1.0 - self.crossing_share)
        angle = np.append(np.column_stack([begin, rests]).ravel(), FULL_TURN * places.size)
        return angle, np.append(np.repeat(places, 2), places[-1] if last else after)


def _layers(wound: WoundDrum, radii: list[float]) -> Iterator[Layer]:
    """Yield the layers of a path, whose centre lines have radii [m]."""
    theta, z, layer = wound.theta, wound.z, wound.layer[:-1]
    steps = np.hypot(np.array(radii)[layer] * np.diff(theta), np.diff(z))
    for k, radius in enumerate(radii):
        inside = np.flatnonzero(layer == k)
        start, end = float(theta[inside[0]]), float(theta[inside[-1] + 1])
        # The last of an orthocyclic one crosses to the next layer already.
        reached = inside[-1] + (wound.winding != "orthocyclic")
        begun = start + FULL_TURN * np.arange(math.ceil((end - start) / FULL_TURN - ROUNDING))
        yield Layer(
            number=k + 1,
            first_turn=start / FULL_TURN,
            last_turn=end / FULL_TURN,
            direction=int(wound.drum.sign) * (1 if k % 2 == 0 else -1),
            radius=radius,
            z=np.interp(begun, theta, z),
            last_z=float(z[reached]),
            length=float(steps[inside].sum()),
        )


@dataclass(frozen=True, kw_only=True)
class DrumShape:
    """Flanges and grooves of the cylinder."""

    drum_width: float = parameter(
        0.0, "width between the flanges", LENGTH, 1.0e-3, 10.0, otherwise="no drum"
    )
    flange: float = parameter(
        0.0, "height of the flanges over the cylinder", LENGTH, 1.0e-4, 5.0, otherwise="none"
    )
    groove_pitch: float = parameter(
        0.0, "pitch of the drum's grooves", LENGTH, 1.0e-4, 0.2, otherwise="a smooth drum"
    )
    start_side: str = parameter(
        "low", "flange at which P0 lies, by its z", PLAIN, choices=tuple(START_SIDES)
    )

    def drum(self, case: Case) -> Drum | None:
        """Return a case's cylinder as a drum; None for one without flanges.

        Raises:
            ParameterError: A width or a height of the flanges is given without the other.
        """
        if not (self.drum_width or self.flange):
            return None
        for name in ("drum_width", "flange"):
            if not getattr(self, name):
                raise ParameterError(f"a drum needs drum_width and flange, {name} is missing")
        return Drum(
            radius=case.cylinder_radius,
            width=self.drum_width,
            flange_height=self.flange,
            groove_pitch=self.groove_pitch or None,
            start_side=self.start_side,
        )


@dataclass(frozen=True, kw_only=True)
class DrumParameters(DrumShape):
    """Flanges and grooves of the cylinder, and how it is filled between them."""

    winding: str = parameter("orthocyclic", "how turns and layers lie", PLAIN, choices=WINDINGS)
    layers: int = parameter(0, "how many layers", PLAIN, 1, 10_000, otherwise="those of the length")
    length: float = parameter(
        0.0,
        "length of cable on the drum",
        LONG_LENGTH,
        1.0e-3,
        1.0e5,
        otherwise="that of the layers",
    )
    crossing_share: float = parameter(
        DrumWinding.crossing_share,
        "share of a turn in which an orthocyclic one crosses to its next place",
        PLAIN,
        0.01,
        0.99,
    )
    edge_dwell: float = parameter(
        DrumWinding.edge_dwell,
        "for how long a parallel or cross winding rests at a flange while it climbs",
        TURNS,
        0.0,
        2.0 * math.pi,
    )

    @classmethod
    def from_options(cls, typed: Mapping[str, object], *, spelling: Spelling = str) -> Self:
        """Return the drum that typed options mean.

        Args:
            typed: By option, in the unit of its name.
            spelling: How a refusal writes an option's name.

        Raises:
            ParameterError: A value is refused, or has no meaning beside the others.
        """
        found = typed_record(cls, typed, spelling)
        if not typed:
            return found
        width, flange = spelling("drum_width_mm"), spelling("flange_mm")
        for value, name in ((found.drum_width, width), (found.flange, flange)):
            if not value:
                raise ParameterError(f"a drum needs {width} and {flange}, {name} is missing")
        useless = "edge_dwell_turns" if found.winding == "orthocyclic" else "crossing_share"
        if useless in typed:
            raise ParameterError(f"{found.winding} winding has no {spelling(useless)}")
        return found

    @property
    def filled(self) -> bool:
        """Whether layers or a length are configured."""
        return bool(self.layers or self.length)

    def wind(self, case: Case, pitch: float | None) -> WoundDrum:
        """Return a case's cylinder as a drum with its cable on it.

        Args:
            case: What is wound.
            pitch: Between turns [m]; None for that of the grooves, or else the cable's diameter.

        Raises:
            ParameterError: There is no drum.
            DrumError: The cable would leave the drum, or has neither layers nor length.
        """
        drum = self.drum(case)
        if drum is None:
            raise ParameterError("cable is wound in layers between the flanges of a drum")
        how = DrumWinding(
            winding=self.winding,
            pitch=pitch,
            crossing_share=self.crossing_share,
            edge_dwell=self.edge_dwell,
        )
        return how.wind(
            drum, case.cable_diameter, layers=self.layers or None, length=self.length or None
        )
