"""What a run is: the one record that a cell file, a command line, a goal and the page make."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, NoReturn, Self

from winding_core import run_options as declared
from winding_core.cable.condition import ALTERNATIVES, Condition, published_case
from winding_core.catalogue.cables import PROPERTIES, check_name, with_cable
from winding_core.cell_file import CellFile, Place, cell_text, read_cell
from winding_core.lay.drum_parameters import DrumParameters
from winding_core.lay.layers import WoundDrum
from winding_core.machine.axes import MachineAxes
from winding_core.markers import MarkerLook
from winding_core.parameters import (
    ParameterError,
    Spelling,
    Value,
    options,
    refuse_unknown,
    typed_record,
    typed_values,
)

# Section -> what it declares.
SECTIONS: Mapping[str, type] = MappingProxyType(
    {
        "condition": Condition,
        "solver": declared.SolverOptions,
        "machine": declared.RunMachine,
        "camera": declared.RunCamera,
        "tracking": declared.RunTracking,
        "lay": declared.LayWish,
        "drum": DrumParameters,
        "correction": declared.RunCorrection,
        "recording": declared.RunRecording,
        "limits": declared.OperatorLimits,
        "run": declared.RunLabels,
        "page": declared.RunPage,
        "graph": declared.RunGraph,
    }
)
# Section -> option -> declaration.
OPTIONS = MappingProxyType({section: options(record) for section, record in SECTIONS.items()})
SECTION_OF = MappingProxyType({key: name for name, keys in OPTIONS.items() for key in keys})
# What most runs are described by.
USUAL = (
    *("case", "cylinder_diameter_mm", "cable_diameter_mm", "tension_n", "young_mpa", "duration_s"),
    *("machine", "turns", "speed", "camera", "control", "program", "pitch_mm"),
    *("weights", "output", "bag", "dashboard", "namespace"),
)
# Of these the one that is given over a file replaces the file's.
_ALTERNATIVES = (*ALTERNATIVES, ("turns", "wound_length_mm"), ("program", "pitch_mm"))
_OF_SIMULATED = (*options(declared.SimulatedMachine), *options(declared.SimulatedCamera))
_OF_EXTERNAL = (*options(MachineAxes), "start", "turns", "wound_length_mm", "standing_s")
_OF_PIXELS = (*options(declared.CameraPixels), "image_transport")
_OF_CAMERA = (
    *_OF_PIXELS,
    *options(declared.CameraClockParameters),
    *options(declared.CameraPlacement),
    *options(declared.LayParameters),
    "compose",
)
# A goal comes over the network: it names no file and no code, and the server owns page and graph.
GOAL_OPTIONS = tuple(
    key
    for key, section in SECTION_OF.items()
    if section not in ("page", "graph", "recording")
    and key not in ("program", "truth", "machine_file", "compose", "weights", "library")
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
        return self.cell.places.get((SECTION_OF.get(name, ""), name))

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
    def at(self, key: str) -> Iterator[None]:
        """Refuse what the body refuses with the place of an option or a section."""
        try:
            yield
        except (ValueError, OSError) as error:
            self.refuse(key, error)


@dataclass(frozen=True, kw_only=True)
class RunSpec:
    """One run as it was asked for."""

    condition: Condition  # What is wound
    solver: declared.SolverOptions  # How the solver winds it
    machine: declared.RunMachine  # Who winds it
    camera: declared.RunCamera  # What looks on
    tracking: declared.RunTracking  # What it looks for
    lay: declared.LayWish  # Wanted; there is one where any option of it is given
    drum: DrumParameters  # Between whose flanges is wound, and how much
    correction: declared.RunCorrection  # Of the predicted lengths
    recording: declared.RunRecording  # What is left, and where
    limits: declared.OperatorLimits  # What is called good
    run: declared.RunLabels  # Which cable, where, by whom
    page: declared.RunPage  # Of an operator
    graph: declared.RunGraph  # Of the nodes
    given: Mapping[str, object] = field(compare=False)  # Option -> value in the option's unit
    source: Source = field(compare=False, repr=False)  # Of the options

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
            ParameterError: A name, a value or a combination is refused.
        """
        refuse_unknown(typed, SECTION_OF, owner="a run")
        cell = None if path is None else read_cell(path, OPTIONS)
        replaced = {
            key for group in _ALTERNATIVES if typed.keys() & {*group} for key in group
        } - typed.keys()
        if typed.get("cable"):
            replaced |= {*PROPERTIES} - typed.keys()
        given = {**(cell.values if cell else {}), **typed}
        given = {key: value for key, value in given.items() if key not in replaced}
        source = Source(typed=frozenset(typed), spelling=spelling, cell=cell)
        library = Path(str(given["library"])) if given.get("library") else None
        if library is not None and not library.is_dir():
            sentence = f"{source.name('library')}: there is no folder of cables {library}"
            source.refuse("library", sentence)
        with source.at("cable"):
            given = with_cable(given, library)
        for key, value in given.items():
            written = str if source.place(key) is not None else spelling
            with source.at(key):
                if key == "case" and isinstance(value, int):
                    published_case(value, written(key))
                typed_values(SECTIONS[SECTION_OF[key]], {key: value}, written)
        given |= _of_filling(given, source)
        sections = {name: _section(name, given, source) for name in SECTIONS}
        spec = cls(given=given, source=source, **sections)
        for key, sentence in spec._contradictions():
            source.refuse(key, sentence)
        return spec

    @classmethod
    def from_goal(cls, wanted: Mapping[str, object]) -> Self:
        """Return the run that a goal describes.

        Raises:
            ParameterError: An option that no goal has, or a value or a combination is refused.
        """
        refuse_unknown(wanted, GOAL_OPTIONS, owner="a goal")
        if wanted.get("cable"):
            check_name(str(wanted["cable"]))
        return cls.from_cell(None, wanted)

    def asked(self, section: str) -> dict[str, Value]:
        """Return the values of a section that were given [SI], by field."""
        record = getattr(self, section)
        return {
            item.name: getattr(record, item.name)
            for key, item in OPTIONS[section].items()
            if key in self.given
        }

    def path(self, key: str) -> Path | None:
        """Return the path that an option names; None where it names none."""
        text = getattr(getattr(self, SECTION_OF[key]), OPTIONS[SECTION_OF[key]][key].name)
        return Path(text) if text else None

    @property
    def domain(self) -> int | None:
        """DDS domain that was asked for; None for the environment's."""
        return self.graph.domain if "domain" in self.given else None

    @property
    def external(self) -> bool:
        """Whether a machine with a driver of its own winds."""
        return self.machine.machine == declared.EXTERNAL

    @property
    def controlled(self) -> bool:
        """Whether a lay is wanted."""
        return bool(self.asked("lay"))

    @property
    def wish(self) -> dict[str, Value]:
        """Parameters of the wanted lay that were given [SI], by field."""
        return {**self.asked("lay"), **self.asked("drum")}

    @property
    def wound_drum(self) -> WoundDrum | None:
        """The drum as it is to be filled; None where that is not configured."""
        if not self.drum.filled:
            return None
        return self.drum.wind(self.condition.resolved().case, self.lay.pitch or None)

    @property
    def labels(self) -> dict[str, str]:
        """Cable, machine, batch, operator and remark, as far as they are known."""
        return self.run.named(Path(self.run.cable).stem, self.machine.machine)

    @property
    def simulated_lay(self) -> str:
        """Where the simulated cable lies."""
        published = self.condition.resolved().case.is_published
        driven = self.controlled or bool(self.drum.drum_width)
        return self.machine.lay or ("driven" if driven else "paper" if published else "fem")

    def text(self) -> str:
        """Return a cell file that describes this run."""
        return cell_text(
            {
                section: {key: self.given[key] for key in keys if key in self.given}
                for section, keys in OPTIONS.items()
            }
        )

    def _contradictions(self) -> Iterator[tuple[str, str]]:
        """Yield options that contradict others, and why."""
        name, camera, lay = self.source.name, self.camera.camera, self.machine.lay
        for key in self._given(_OF_SIMULATED if self.external else _OF_EXTERNAL):
            who = "the simulated machine" if self.external else "an external machine"
            yield key, f"{name(key)} is for {who}: see {name('machine')}"
        for one, other in _ALTERNATIVES:
            if one in self.given and other in self.given:
                yield one, f"give {name(one)} or {name(other)}, not both"
        if self.camera.frame_rate not in (200, 1000):
            sentence = f"must be 200 or 1000, got {self.camera.frame_rate}"
            yield "frame_rate", f"{name('frame_rate')} {sentence}"
        if not camera and not self.external:
            yield "camera", f"the simulated machine has a camera: see {name('machine')}"
        pixels, needing = self._given(_OF_PIXELS), self._given(_OF_CAMERA)
        if pixels and not self.external and self.camera.compose in ("", "camera"):
            who = "for the pictures of a real camera, not the simulated one's"
            yield pixels[0], f"{self._listed(pixels, 'are', 'is')} {who}"
        if needing and not camera:
            yield needing[0], f"{self._listed(needing, 'need', 'needs')} a camera"
        if self.camera.compose:
            for sentence in self._uncomposed():
                yield "compose", sentence
        if lay not in ("", "driven") and self.controlled and self.lay.control == "drive":
            reason = f"{name('control')} drive moves the cable"
            yield "lay", f"{reason}, and {name('lay')} {lay} does not: use driven"
        if lay == "paper" and not self.condition.resolved().case.is_published:
            reason = "paper is what the paper measured of cases 1 to 12; use fem"
            yield "lay", f"{name('lay')} {reason}"
        if lay not in ("", "driven") and self.drum.drum_width:
            yield "lay", f"{name('lay')} {lay} lies on a bare cylinder: on a drum use driven"
        if self.drum.filled:
            for key in self._given(("program", "markers_every_turn")):
                yield key, f"a drum has a program of its own: leave out {name(key)}"
            if self.lay.control != "drive":
                reason = "the drive programme's guide does not turn at the flanges"
                yield "control", f"{name('control')} must be drive to fill a drum: {reason}"
        if "lay_tolerance_mm" in self.given and not self.controlled:
            wishes = f"give {name('control')}, {name('program')} or {name('pitch_mm')}, too"
            yield "lay_tolerance_mm", f"{name('lay_tolerance_mm')} judges a wanted lay: {wishes}"
        if "dashboard_port" in self.given and not self.page.dashboard:
            who = f"a run with {name('dashboard')}"
            yield "dashboard_port", f"{name('dashboard_port')} is for {who}"

    def _uncomposed(self) -> Iterator[str]:
        """Yield why a camera cannot run in the tracker's process."""
        name, compose = self.source.name, self.source.name("compose")
        if self.graph.attach:
            yield f"with {name('attach')} the tracker runs elsewhere: compose its camera there"
        if self.camera.image_transport != "raw":
            yield f"{compose} hands frames over: leave out {name('image_transport')}"
        if self.graph.secure:
            reason = "no policy lets the tracker show frames"
            yield f"{compose} and {name('secure')} exclude each other: {reason}"
        if not self.external and self.camera.compose != "camera":
            yield f"the simulated machine has a camera of its own: {compose} takes camera"
        if self.external and self.camera.compose == "camera":
            yours = "name what opens yours, MODULE:FUNCTION or FILE.py:FUNCTION"
            yield f"{compose} camera is for the simulated machine; {yours}"
        if self.simulated_lay == "driven" and not self.external:
            reason = "is shown by the rig's own camera alone"
            yield f"{name('lay')} driven {reason}: leave out {compose}"

    def _given(self, keys: Iterable[str]) -> list[str]:
        return [key for key in keys if key in self.given]

    def _listed(self, keys: list[str], many: str, one: str) -> str:
        *words, last = map(self.source.name, keys)
        return f"{', '.join(words)} and {last} {many}" if words else f"{last} {one}"


_BEFORE_FULL_MS = 3  # So much earlier ends what fills a drum [ms]


def _of_filling(given: Mapping[str, object], source: Source) -> dict[str, object]:
    """Return what follows where a drum is filled: it is driven until it is full."""
    if not (given.get("layers") or given.get("length_m")):
        return {}
    condition, lay, drum = (_section(name, given, source) for name in ("condition", "lay", "drum"))
    what = condition.resolved()
    with source.at("drum:"):
        wound = drum.wind(what.case, lay.pitch or None)
    # The cylinder comes to rest a milliradian beyond its place, and what is full takes no more.
    whole = math.floor(1e3 * what.drive.time_at_angle(float(wound.theta[-1])))
    time = (whole - _BEFORE_FULL_MS) / 1e3
    if "duration_s" in given and condition.duration > time:
        sentence = f"is wound in {time:g} s, got {source.name('duration_s')} {condition.duration:g}"
        source.refuse("duration_s", f"what goes on the drum {sentence}")
    follows = {"duration_s": time, "control": "drive"}
    return {key: value for key, value in follows.items() if key not in given}


def _section(name: str, given: Mapping[str, object], source: Source) -> Any:
    """Return a section's record; refuse a combination where it stands."""
    record = SECTIONS[name]
    values = {key: given[key] for key in OPTIONS[name] if key in given}
    # An operator may prepare another one.
    case = Condition.case if given.get("dashboard") is True else None

    def made(keys: Mapping[str, object]) -> Any:
        if record is Condition:
            return Condition.from_typed(keys, spelling=source.name, case=case)
        if record is DrumParameters:
            return DrumParameters.from_options(keys, spelling=source.name)
        built: object = typed_record(record, keys, source.name)
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
