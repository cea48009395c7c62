"""From what a run is to what its graph is run with, and what is refused before it starts."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from winding_core.parameters import ParameterError, build, declarations, declared_in, refuse_unknown
from winding_core.run_spec import RunSpec
from winding_recorder.bags.description import PARAMETERS
from winding_recorder.live.recorder import RecorderError
from winding_ros.graph import (
    FEM,
    LAY_CONTROL,
    PAGE,
    RIG,
    SIMULATED_CAMERA,
    TRACKER,
    NodeSpec,
    composed,
    compressed,
    members,
    pace_topics,
    parameters_of,
)
from winding_ros.runtime.parameter_files import check_readable, declared_names, parameters_for
from winding_supervisor.machines.external_machine import ExternalMachineConfig
from winding_supervisor.session.domain_lock import chosen_domain

Axes = Mapping[str, object]  # Parameters of those nodes that read the machine's axes
# The machine stops when the orchestrator has given no sign of life for so long.
_SUPERVISOR_TIMEOUT = 1.5


class RunFolderError(ValueError):
    """The run's folder is there already; nothing is written over another run."""


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """A run, where it goes, and what its options alone do not determine."""

    spec: RunSpec  # As it was asked for
    directory: Path  # New folder of logs and of what the run leaves behind
    machine: ExternalMachineConfig | None = None  # The external machine; None for the simulated one
    # Parameters of the operator's page; None for a run that starts by itself
    page: Mapping[str, object] | None = None
    notes: Mapping[str, str] = field(default_factory=dict)  # Texts of its recordings, by name
    attended: bool = False  # Whether an operator sits at the terminal
    # Cylinder angle [rad] and pull [N] of each corner of what is commanded of the brake
    pulls: tuple[tuple[float, float], ...] = ()

    @property
    def log_directory(self) -> Path:
        """Folder of the nodes' output."""
        return self.directory / "log"

    @property
    def numbered(self) -> bool:
        """Whether a number is added to the folder's name when it is taken."""
        return not self.spec.recording.output

    @property
    def listed_runs(self) -> Path:
        """Folder whose runs the operator's page lists: those beside a folder with a number."""
        return (self.directory.parent if self.numbered else self.directory).absolute()

    @property
    def graph(self) -> tuple[NodeSpec, ...]:
        """The nodes of the run."""
        spec = self.spec
        graph = members(external=spec.external, camera=spec.camera.camera, control=spec.controlled)
        if not spec.camera.compose:
            return compressed(graph) if spec.camera.image_transport == "compressed" else graph
        return composed(graph, spec.camera.compose if spec.external else SIMULATED_CAMERA)

    def own_parameters(self, axes: Axes | None = None) -> dict[str, dict[str, object]]:
        """Return what the run itself sets, by node."""
        spec, found = self.spec, {}
        sections = ("solver", "camera", "tracking", "correction", "lay", "drum")
        asked = {**(axes or {}), **{k: v for name in sections for k, v in spec.asked(name).items()}}
        condition = spec.condition
        common = {"case": condition.case, "duration": condition.duration}
        for node in self.graph:
            found[node.name] = {
                **spec.asked("condition"), **common, **declared_in(parameters_of(node), asked)
            }  # fmt: skip
        if RIG.name in found:
            found[RIG.name] |= self._rig_parameters()
        if spec.controlled:
            limits = {item.name: item.default for item in declarations(parameters_of(LAY_CONTROL))}
            found[FEM.name]["carriage_speed"] = limits["guide_speed_limit"]
            if TRACKER.name in found:
                found[TRACKER.name]["measure_lay"] = True
        return found

    def _rig_parameters(self) -> dict[str, object]:
        spec = self.spec
        asked = declared_in(parameters_of(RIG), spec.asked("machine"))
        for name in ("truth_file", "machine_file"):
            if file := getattr(spec.machine, name):
                asked[name] = str(Path(file).absolute())
        if spec.camera.compose:
            asked["camera_elsewhere"] = True
        paced = ",".join(topic.name for topic in pace_topics(self.graph))
        return {
            **asked,
            "lay": spec.simulated_lay,
            "pace_topics": paced,
            "supervisor_timeout": _SUPERVISOR_TIMEOUT,
        }

    def file_parameters(self, node: str) -> dict[str, object]:
        """Return what the user's file sets of a node's declared parameters."""
        file = self.spec.path("parameters")
        if file is None:
            return {}
        return declared_names(parameters_for(file, f"/{self.spec.graph.namespace}/{node}"))

    def parameters(self, axes: Axes | None = None) -> dict[str, dict[str, object]]:
        """Return what every node is run with; the run's own values go over the file's."""
        return {
            name: self.file_parameters(name) | own
            for name, own in self.own_parameters(axes).items()
        }


def check_run(config: RunConfig) -> None:
    """Refuse what can be refused before any process starts.

    Raises:
        ParameterError: A node's parameter has an unknown name or a bad value.
        ValueError: The parameter file cannot be read.
        DomainError: The domain is not a domain.
        RecorderError: The bag exists already.
        RunFolderError: The folder exists already.
    """
    file, own, bag = (
        config.spec.path("parameters"), config.own_parameters(), config.spec.path("bag")
    )  # fmt: skip
    if file is not None:
        check_readable(file)
    for node in config.graph:
        kind, values = parameters_of(node), config.file_parameters(node.name)
        known = [item.name for item in declarations(kind)]
        refuse_unknown(values, known, owner=f"{file}: {node.name}")
        try:
            build(kind, values, owner=node.name)
        except ParameterError as error:
            raise ParameterError(f"{file}: {node.name}: {error}") from None
        build(kind, own[node.name], owner=node.name)
    chosen_domain(config.spec.domain)
    if config.page is not None:
        page: Any = build(parameters_of(PAGE), config.page, owner=PAGE.name)
        page.check()
    if bag is not None and bag.exists():
        raise RecorderError(f"{bag} exists already; a recording is never overwritten")
    if config.directory.exists() and not config.numbered:
        raise _taken(config.directory)


def claim_folder(config: RunConfig) -> Path:
    """Make the run's folder and return it; runs that start in one second get one each.

    Raises:
        RunFolderError: It exists and may have no number.
        OSError: It cannot be made.
    """
    candidate, count = config.directory, 1
    while True:
        try:
            candidate.mkdir(parents=True)
        except FileExistsError:
            if not config.numbered:
                raise _taken(candidate) from None
            count += 1
            candidate = config.directory.with_name(f"{config.directory.name}-{count}")
        else:
            return candidate


def _taken(folder: Path) -> RunFolderError:
    return RunFolderError(f"{folder} exists already; a run is never written over another")


def parameter_notes(parameters: Mapping[str, Mapping[str, object]]) -> dict[str, str]:
    """Return the parameters of every node as a bag keeps them, for its replay."""
    return {f"{PARAMETERS}{name}": json.dumps(dict(own)) for name, own in parameters.items()}
