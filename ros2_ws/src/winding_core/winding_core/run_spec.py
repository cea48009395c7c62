"""What a run is: the one record that a cell file, a command line, a goal and the page make."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, NoReturn, Self

from winding_core.cable.condition import Condition, published_case
from winding_core.cell_file import CellFile, Place, cell_text, read_cell
from winding_core.machine.axes import MachineAxes
from winding_core.markers import MarkerLook
from winding_core.parameters import (
    Declaration,
    ParameterError,
    Spelling,
    Value,
    build,
    options,
    refuse_unknown,
    typed_values,
)
from winding_core.run_options import (
    EXTERNAL,
    CameraClockParameters,
    CameraPixels,
    CameraPlacement,
    LayParameters,
    LayWish,
    OperatorLimits,
    RunCamera,
    RunCorrection,
    RunGraph,
    RunMachine,
    RunPage,
    RunRecording,
    RunTracking,
    SimulatedCamera,
    SimulatedMachine,
)

# Section -> what it declares.
SECTIONS: Mapping[str, type] = MappingProxyType(
    {
        "condition": Condition,
        "machine": RunMachine,
        "camera": RunCamera,
        "tracking": RunTracking,
        "lay": LayWish,
        "correction": RunCorrection,
        "recording": RunRecording,
        "limits": OperatorLimits,
        "page": RunPage,
        "graph": RunGraph,
    }
)
# Section -> option -> declaration.
OPTIONS: Mapping[str, Mapping[str, Declaration]] = MappingProxyType(
    {section: options(record) for section, record in SECTIONS.items()}
)
# What most runs are described by.
USUAL = (
    *("case", "cylinder_diameter_mm", "cable_diameter_mm", "tension_n", "young_mpa", "duration_s"),
    *("machine", "turns", "speed", "camera", "control", "program", "pitch_mm"),
    *("weights", "output", "bag", "dashboard", "namespace"),
)
# Of these the one that is given over a file replaces the file's.
_ALTERNATIVES = (
    ("tension_n", "tension_mpa"),
    ("free_length_mm", "guide_distance_mm"),
    ("turns", "wound_length_mm"),
    ("program", "pitch_mm"),
)
_OF_SIMULATED = (*options(SimulatedMachine), *options(SimulatedCamera))
_OF_EXTERNAL = (*options(MachineAxes), "start", "turns", "wound_length_mm", "standing_s")
_OF_CAMERA = (
    *options(CameraPixels),
    *options(CameraClockParameters),
    *options(CameraPlacement),
    *options(LayParameters),
    "compose",
)
# A goal comes over the network: it names no file and no code, and the server owns page and graph.
GOAL_OPTIONS = tuple(
    key
    for section, declared in OPTIONS.items()
    if section not in ("page", "graph", "recording")
    for key, item in declared.items()
    if not (item.unit is not None and item.unit.path) and key not in ("compose", "weights")
)


@dataclass(frozen=True, kw_only=True)
class Source:
    """Where options came from, for refusals."""

    typed: frozenset[str] = frozenset()  # Options that were given beside the file
    spelling: Spelling = str  # How such an option is written
    cell: CellFile | None = None  # The file

    def place(self, name: str) -> Place | None:
        """Return where an option, or a section as `lay:`, stands in the file; None without one."""
        if self.cell is None or name in self.typed:
            return None
        if name.endswith(":"):
            return self.cell.sections.get(name[:-1], self.cell.start)
        return self.cell.places.get(name)

    def name(self, key: str) -> str:
        """Return how a sentence names an option."""
        place = self.place(key)
        if place is not None:
            return f"{key} (line {place.line})"
        return self.spelling(key) if self.cell is None or key in self.typed else key

    def label(self, key: str) -> str:
        """Return how a refusal of an option begins."""
        place = self.place(key)
        return self.spelling(key) if place is None else f"{place}: {key}"

    def refuse(self, key: str, sentence: object) -> NoReturn:
        """Raise ParameterError with the place of an option or a section."""
        place = self.place(key)
        raise ParameterError(f"{sentence}" if place is None else f"{place}: {sentence}")

    @contextmanager
    def at(self, key: str, *, named: bool = False) -> Iterator[None]:
        """Refuse what the body refuses with the place of an option or a section.

        Args:
            key: Of the option or the section.
            named: Whether the sentences of the body need the option's name before them.

        Raises:
            ParameterError: Of a ValueError or an OSError of the body.
        """
        try:
            yield
        except (ValueError, OSError) as error:
            name = key if self.place(key) is not None else self.spelling(key)
            self.refuse(key, f"{name}: {error}" if named else error)


@dataclass(frozen=True, kw_only=True)
class RunSpec:
    """One run as it was asked for."""

    condition: Condition
    machine: RunMachine
    camera: RunCamera
    tracking: RunTracking
    lay: LayWish  # Wanted; there is one where any option of it is given
    correction: RunCorrection
    recording: RunRecording
    limits: OperatorLimits
    page: RunPage
    graph: RunGraph
    given: Mapping[str, Mapping[str, object]]  # Section -> option -> value in the option's unit
    source: Source = field(default_factory=Source, compare=False, repr=False)

    @classmethod
    def from_cell(
        cls, path: Path | None, typed: Mapping[str, object], spelling: Spelling = str
    ) -> Self:
        """Return the run of a cell file with options over it.

        Args:
            path: Of the file; None for options alone.
            typed: Option -> value in its unit; they win over the file.
            spelling: How a refusal writes an option's name.

        Raises:
            CellError: The file is refused.
            ParameterError: A value or a combination is refused.
        """
        cell = None if path is None else read_cell(path, OPTIONS)
        return cls.from_options(typed, Source(typed=frozenset(typed), spelling=spelling, cell=cell))

    @classmethod
    def from_goal(cls, wanted: Mapping[str, object]) -> Self:
        """Return the run that a goal describes.

        Raises:
            ParameterError: An option that no goal has, or a value or a combination is refused.
        """
        refuse_unknown(wanted, GOAL_OPTIONS, owner="a goal")
        return cls.from_options(wanted)

    @classmethod
    def from_options(cls, typed: Mapping[str, object], source: Source | None = None) -> Self:
        """Return the run that options describe, over those of the source's file.

        Raises:
            ParameterError: A name, a value or a combination is refused.
        """
        source = source or Source(typed=frozenset(typed))
        refuse_unknown(typed, [key for keys in OPTIONS.values() for key in keys], owner="a run")
        of_file = dict(source.cell.values) if source.cell is not None else {}
        for group in _ALTERNATIVES:
            if source.typed & set(group):
                of_file = {key: value for key, value in of_file.items() if key not in group}
        merged = of_file | dict(typed)
        given: dict[str, dict[str, object]] = {section: {} for section in OPTIONS}
        for section, declared in OPTIONS.items():
            for key, item in declared.items():
                if key in merged:
                    given[section][key] = _checked(key, item, merged[key], source, section)
        operated = given["page"].get("dashboard") is True
        case = Condition.case if operated else None
        spec = cls(
            given=given,
            source=source,
            **{name: _section(name, values, source, case) for name, values in given.items()},
        )
        spec._check()
        return spec

    def asked(self, section: str) -> dict[str, Value]:
        """Return the values of a section that were given [SI], by field."""
        record = getattr(self, section)
        return {
            item.name: getattr(record, item.name)
            for key, item in OPTIONS[section].items()
            if key in self.given[section]
        }

    @property
    def external(self) -> bool:
        """Whether a machine with a driver of its own winds."""
        return self.machine.machine == EXTERNAL

    @property
    def controlled(self) -> bool:
        """Whether a lay is wanted."""
        return bool(self.given["lay"])

    @property
    def simulated_lay(self) -> str:
        """Where the simulated cable lies."""
        published = self.condition.resolved().case.is_published
        return self.machine.lay or (
            "driven" if self.controlled else "paper" if published else "fem"
        )

    def text(self) -> str:
        """Return a cell file that describes this run."""
        return cell_text(self.given)

    def _given(self, keys: Iterable[str]) -> list[str]:
        return [key for key in keys if any(key in values for values in self.given.values())]

    def _check(self) -> None:
        """Refuse options that contradict each other."""
        name, refuse = self.source.name, self.source.refuse
        other = _OF_SIMULATED if self.external else _OF_EXTERNAL
        for key in self._given(other):
            who = "the simulated machine" if self.external else "an external machine"
            refuse(key, f"{name(key)} is for {who}: see {name('machine')}")
        if len(self._given(("turns", "wound_length_mm"))) == 2:
            refuse("turns", f"give {name('turns')} or {name('wound_length_mm')}, not both")
        if len(self._given(("program", "pitch_mm"))) == 2:
            refuse("program", f"give {name('program')} or {name('pitch_mm')}, not both")
        if self.camera.frame_rate not in (200, 1000):
            label = name("frame_rate")
            refuse("frame_rate", f"{label} must be 200 or 1000, got {self.camera.frame_rate}")
        self._check_camera()
        self._check_lay()
        if self.given["page"] and not self.page.dashboard:
            for key in self._given(("dashboard_port",)):
                refuse(key, f"{name(key)} is for a run with {name('dashboard')}")

    def _check_camera(self) -> None:
        name, refuse, compose = self.source.name, self.source.refuse, self.camera.compose
        if not self.camera.camera and not self.external:
            refuse("camera", "the simulated machine has a camera: see " + name("machine"))
        pixels = self._given(options(CameraPixels))
        if pixels and not (self.external or compose not in ("", "camera")):
            sentence = "for the pictures of a real camera, not the simulated one's"
            refuse(pixels[0], f"{self._listed(pixels, 'are', 'is')} {sentence}")
        needing = self._given(_OF_CAMERA)
        if needing and not self.camera.camera:
            refuse(needing[0], f"{self._listed(needing, 'need', 'needs')} a camera")
        if not compose:
            return
        if self.graph.attach:
            refuse(
                "compose",
                f"with {name('attach')} the tracker runs elsewhere: compose its camera there",
            )
        if self.graph.secure:
            refuse(
                "compose",
                f"{name('compose')} and {name('secure')} exclude each other: no policy lets the "
                "tracker show frames",
            )
        if not self.external and compose != "camera":
            refuse(
                "compose",
                f"the simulated machine has a camera of its own: {name('compose')} takes camera",
            )
        if self.external and compose == "camera":
            refuse(
                "compose",
                f"{name('compose')} camera is for the simulated machine; name what opens yours, "
                "MODULE:FUNCTION or FILE.py:FUNCTION",
            )

    def _check_lay(self) -> None:
        name, refuse, lay = self.source.name, self.source.refuse, self.machine.lay
        if lay not in ("", "driven") and self.controlled and self.lay.control == "drive":
            refuse(
                "lay",
                f"{name('control')} drive moves the cable, and {name('lay')} {lay} does not: use "
                "driven",
            )
        if self.simulated_lay == "driven" and self.camera.compose and not self.external:
            refuse(
                "compose",
                f"{name('lay')} driven is shown by the rig's own camera alone: leave out "
                f"{name('compose')}",
            )
        if lay == "paper" and not self.condition.resolved().case.is_published:
            refuse(
                "lay", f"{name('lay')} paper is what the paper measured of cases 1 to 12; use fem"
            )
        if not self.controlled and (judged := self._given(("lay_tolerance_mm",))):
            refuse(
                judged[0],
                f"{name(judged[0])} judges a wanted lay: give {name('control')}, "
                f"{name('program')} or {name('pitch_mm')}, too",
            )

    def _listed(self, keys: list[str], many: str, one: str) -> str:
        words = [self.source.name(key) for key in keys]
        if len(words) == 1:
            return f"{words[0]} {one}"
        return f"{', '.join(words[:-1])} and {words[-1]} {many}"


def _checked(key: str, item: Declaration, value: object, source: Source, section: str) -> object:
    """Return a value as a cell file has it; refuse it where it stands."""
    in_file = source.place(key) is not None
    spelling = str if in_file else source.spelling
    with source.at(key):
        if key == "case" and isinstance(value, int):
            published_case(value, spelling(key))
        if in_file and isinstance(item.default, list) and isinstance(value, str):
            raise ParameterError(f"{key} must be a list of numbers, got {value!r}")
        typed_values(SECTIONS[section], {key: value}, spelling)
    if isinstance(value, Path):
        return str(value)
    if isinstance(item.default, list) and isinstance(value, str):
        return [float(number) for number in value.split(",")]
    return value


def _section(name: str, values: Mapping[str, object], source: Source, case: int | None) -> Any:
    """Return a section's record; refuse a combination where it stands."""
    record = SECTIONS[name]

    def made(keys: Mapping[str, object]) -> Any:
        if record is Condition:
            return Condition.from_typed(keys, spelling=source.name, case=case)
        built: Any = build(record, typed_values(record, keys, source.name), owner="a run")
        if isinstance(built, MarkerLook):
            _ = built.hues
        return built

    try:
        return made(values)
    except ValueError as error:
        beside = {"case": values.get("case", Condition.case)} if record is Condition else {}
        for key, value in values.items():
            # One that is refused alone is to blame, else the section as a whole.
            try:
                made({**beside, key: value})
            except ValueError:
                source.refuse(key, error)
        if values and source.typed >= values.keys():
            raise ParameterError(str(error)) from error
        source.refuse(f"{name}:", error)
