"""What a run of the graph is configured with, and what is refused before it starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path

from winding_core.parameters import ParameterError, build
from winding_recorder.bags.mcap_file import BagConfig
from winding_recorder.live.recorder import RecorderError
from winding_ros import topics
from winding_ros.graph import (
    DEFAULT_NAMESPACE,
    GRAPH,
    PAGE,
    RIG,
    TRACKER,
    NodeSpec,
    composed,
    controlled,
    pace_topics,
    parameters_of,
)
from winding_ros.runtime.parameter_files import check_readable, declared_names, parameters_for
from winding_supervisor.machines.external_machine import ExternalMachineConfig
from winding_supervisor.session.domain_lock import chosen_domain

# The machine stops when the orchestrator has given no sign of life for so long.
_SUPERVISOR_TIMEOUT = 1.5


class RunFolderError(ValueError):
    """The run's folder is there already; nothing is written over another run."""


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """One run of the graph.

    Attributes:
        page: Parameters of the operator's page; None for a run that starts by itself.
        compose: What opens a camera in the tracker's process, as MODULE:FUNCTION; empty for one
            that publishes its frames.
        notes: What its recordings say of the run beside the parameters, by name.
    """

    directory: Path  # New folder of logs and of what the run leaves behind
    condition: Mapping[str, object]  # Parameters that every node shares (`Condition`)
    own: Mapping[str, Mapping[str, object]]  # Node name -> parameters of that node alone
    duration: float  # Simulated length [s]
    numbered: bool = False  # Whether a number is added to the folder's name when it is taken
    bag: Path | None = None  # Where to record, or None
    recording: BagConfig = field(default_factory=BagConfig)  # How the bag is stored
    parameters_file: Path | None = None  # The user's own parameter file
    domain: int | None = None  # DDS domain, or None for the environment's
    namespace: str = DEFAULT_NAMESPACE  # Namespace of the graph
    attach: bool = False  # Whether the nodes run elsewhere; no process is started or ended here
    machine: ExternalMachineConfig | None = None  # The external machine; None for the simulated one
    page: Mapping[str, object] | None = None
    trace: bool = False  # Whether the nodes note the way of each corrected length
    compose: str = ""
    lay_control: bool = False  # Whether the controller of the lay is one of the nodes
    notes: Mapping[str, str] = field(default_factory=dict)
    attended: bool = False  # Whether an operator sits at the terminal

    @property
    def log_directory(self) -> Path:
        """Folder of the nodes' output."""
        return self.directory / "log"

    @property
    def listed_runs(self) -> Path:
        """Folder whose runs the operator's page lists: those beside a folder with a number."""
        return (self.directory.parent if self.numbered else self.directory).absolute()

    @property
    def graph(self) -> tuple[NodeSpec, ...]:
        """The nodes of the run; a real machine needs no rig, and without a camera no tracker."""
        graph = GRAPH
        if self.machine is not None:
            camera = self.machine.camera
            graph = tuple(s for s in GRAPH if s is not RIG and (camera or s is not TRACKER))
        if self.lay_control:
            graph = controlled(graph)
        return composed(graph, self.compose) if self.compose else graph

    def own_parameters(
        self, axes: Mapping[str, object] | None = None
    ) -> dict[str, dict[str, object]]:
        """Return what the run itself sets, by node.

        Args:
            axes: Parameters of those nodes that read the machine's axes.
        """
        parameters = {
            spec.name: {
                **self.condition,
                **_declared(spec, axes or {}),
                **self.own.get(spec.name, {}),
            }
            for spec in self.graph
        }
        if topics.RIG in parameters:
            parameters[topics.RIG]["pace_topics"] = ",".join(
                topic.name for topic in pace_topics(self.graph)
            )
            parameters[topics.RIG]["supervisor_timeout"] = _SUPERVISOR_TIMEOUT
            if self.compose:
                parameters[topics.RIG]["camera_elsewhere"] = True
        return parameters

    def file_parameters(self, node: str) -> dict[str, object]:
        """Return what the user's file sets of a node's declared parameters."""
        if self.parameters_file is None:
            return {}
        return declared_names(parameters_for(self.parameters_file, f"/{self.namespace}/{node}"))

    def parameters(self, axes: Mapping[str, object] | None = None) -> dict[str, dict[str, object]]:
        """Return what every node is run with; the run's own values go over the file's.

        Args:
            axes: Parameters of those nodes that read the machine's axes.
        """
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
    if config.parameters_file is not None:
        check_readable(config.parameters_file)
    for spec in config.graph:
        kind = parameters_of(spec)
        try:
            build(kind, config.file_parameters(spec.name), owner=spec.name)
        except ParameterError as error:
            raise ParameterError(
                f"{config.parameters_file}: {_about(spec.name, str(error))}"
            ) from None
        build(kind, config.own_parameters()[spec.name], owner=spec.name)
    chosen_domain(config.domain)
    if config.page is not None:
        build(parameters_of(PAGE), config.page, owner=PAGE.name).check()
    if config.bag is not None and config.bag.exists():
        raise RecorderError(f"{config.bag} exists already; a recording is never overwritten")
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


def _declared(spec: NodeSpec, values: Mapping[str, object]) -> dict[str, object]:
    known = {item.name for item in fields(parameters_of(spec))}
    return {name: value for name, value in values.items() if name in known}


def _about(node: str, sentence: str) -> str:
    return sentence if sentence.startswith(f"{node} ") else f"{node}: {sentence}"


def _taken(folder: Path) -> RunFolderError:
    return RunFolderError(f"{folder} exists already; a run is never written over another")
