"""Start the graph's processes, drive them to active, watch them, stop them in reverse."""

import asyncio
import contextlib
from collections.abc import Callable, Collection, Coroutine, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from winding_core.compile_progress import COMPILING
from winding_core.parameters import declarations
from winding_ros.client.async_client import AsyncClient
from winding_ros.client.lifecycle import (
    ACTIVATE,
    ANSWER_PATIENCE,
    CONFIGURE_TIMEOUT,
    DEACTIVATE,
    START_TIMEOUT,
    LifecycleDriver,
    deadline,
)
from winding_ros.graph import GRAPH, GraphError, NodeSpec, parameters_of, without_replay
from winding_ros.runtime.parameter_files import parameters_for
from winding_supervisor.processes.beside import beside
from winding_supervisor.processes.discovery import PATIENCE, Discovery
from winding_supervisor.processes.members import AttachedNode, Member, configure, exit_error
from winding_supervisor.processes.node_process import node_process

# A successor may hang as its predecessor did [s].
_RESTART_PATIENCE = (20.0, 60.0, CONFIGURE_TIMEOUT)
_POLL = 0.02
_NARRATION_PERIOD = 2.0
_FORGETTING = 0.5
# The answer to a transition may overtake the sentence on the node's own output.
_REFUSAL_PATIENCE = 5.0
_FAREWELL_PATIENCE = 2.0


@dataclass(frozen=True, kw_only=True)
class GraphConfig:
    """How a graph is run."""

    namespace: str  # Without slashes around it
    log_directory: Path  # Folder of the nodes' output
    parameters: Mapping[str, Mapping[str, object]]  # Node name -> parameter name -> value
    parameters_file: Path | None = None  # Parameter file of the user, given to every node
    recorded: frozenset[str] = frozenset()  # Topics that the recorder of this process listens to
    attach: bool = False  # Whether the nodes run elsewhere, such as in a container each
    graph: tuple[NodeSpec, ...] = GRAPH  # The nodes, those first that only listen
    sim_time: bool = True  # Whether the nodes' time is the simulated machine's


@dataclass(eq=False)
class Orchestrator:
    """Runs one graph; every wait is for a state, none for a time."""

    config: GraphConfig  # How it is run
    client: AsyncClient  # Calls its services and hears its diagnostics
    # Takes a sentence now and then while nodes compile
    report: Callable[[str], object] = lambda sentence: None

    def __post_init__(self) -> None:
        self._narrated = ""
        self._transitions = LifecycleDriver(
            self.client, self.config.namespace, self._reason, self._work
        )
        self.processes: list[Member] = [self._process(spec) for spec in self.config.graph]
        self._active: set[str] = set()
        self._matching = Discovery(self.client, self.config.recorded, self.config.graph)
        # What the nodes were found to be set to, for those that are started again.
        self._adopted: dict[str, dict[str, object]] = {}

    async def start(self) -> None:
        """Start every process."""
        for process in self.processes:
            await process.start()

    async def bring_up(self) -> None:
        """Configure all nodes, activate them sinks first, wait until all are matched."""
        await self._while_alive(self._configure_all())
        for process in self.processes:
            await self._while_alive(
                self._transitions.change(process.spec.name, ACTIVATE, START_TIMEOUT)
            )
            self._active.add(process.spec.name)
        await self._while_alive(self._matching.complete(self.down))

    def process(self, name: str) -> Member:
        """Return a node's present process."""
        return next(process for process in self.processes if process.spec.name == name)

    def pids(self) -> dict[str, int]:
        """Return the process ids of the nodes that run."""
        return {
            process.spec.name: process.pid
            for process in self.processes
            if process.started and process.return_code is None
        }

    async def restart(
        self, name: str, extra: Mapping[str, object], late: Callable[[str], object]
    ) -> None:
        """Kill what is left of a node, start it anew and bring it to active.

        A successor that hangs or is killed is followed by another. No other node takes part.

        Args:
            name: The node.
            extra: Parameters beside those that it was started with.
            late: Takes what became of a successor that is given up, to follow the node's name.

        Raises:
            GraphError, TimeoutError: It does not come up again.
        """
        for patience in _RESTART_PATIENCE:
            idle = f"no answer and no work in {patience:g} s"
            try:
                async with deadline(patience, idle, partial(self._work, name)):
                    await self._replace(name, extra)
            except (GraphError, TimeoutError) as error:
                refused = isinstance(error, GraphError) and not self._killed(name)
                if refused or patience == _RESTART_PATIENCE[-1]:
                    raise
                late(f"was not active again: {error}")
            else:
                return

    async def _replace(self, name: str, extra: Mapping[str, object]) -> None:
        old = self.process(name)
        self._active.discard(name)
        await old.kill()
        new = self._process(old.spec, {**self._adopted.get(name, {}), **extra})
        self.processes[self.processes.index(old)] = new
        await new.start()
        await self._while_alive(configure(self._transitions, new), [new])
        await self._while_alive(self._transitions.change(name, ACTIVATE, CONFIGURE_TIMEOUT), [new])
        self._active.add(name)

    async def rematch(self, names: Collection[str]) -> None:
        """Wait until the graph has forgotten killed processes and matches their successors.

        A node that is down meanwhile is not waited for: its own restart matches it.

        Raises:
            GraphError: A subscriber among those that are up does not find its publisher.
            TimeoutError: The graph does not forget.
        """
        async with deadline(PATIENCE, f"the graph does not forget a killed {', '.join(names)}"):
            while any(self.client.present(name) != 1 for name in set(names) - self.down()):
                await asyncio.sleep(_POLL)
        # Each process forgets for itself, a little earlier or later than this one.
        await asyncio.sleep(_FORGETTING)
        await self._matching.complete(self.down)

    def down(self) -> frozenset[str]:
        """Return the names of the nodes that have ended, or are not active."""
        ended = {item.spec.name for item in self.processes if item.return_code is not None}
        return frozenset(ended | set(self._names) - self._active)

    async def adopt_parameters(self) -> dict[str, dict[str, object]]:
        """Return what every node is set to now; a node that is restarted gets the same.

        A node that does not answer keeps what was known of it.
        """
        for process in self.processes:
            name = process.spec.name
            declared = [item.name for item in declarations(parameters_of(process.spec))]
            with contextlib.suppress(TimeoutError):
                values = await self._transitions.parameters(name, declared, ANSWER_PATIENCE)
                if len(values) == len(declared):
                    self._adopted[name] = values
        return dict(self._adopted)

    async def bring_up_anew(self, parameters: Mapping[str, Mapping[str, object]]) -> None:
        """Take every node down and bring it up with other parameters; one that has ended, too.

        Raises:
            GraphError, TimeoutError: A node refuses, or does not come up.
        """
        self.config = replace(self.config, parameters=parameters)
        self._adopted = {}
        for process in tuple(self.processes):
            if process.started and process.return_code is not None:
                await self._replace(process.spec.name, {})
        fresh = without_replay(self.config.graph)
        values = {name: {**parameters.get(name, {}), **fresh.get(name, {})} for name in self._names}
        await self._while_alive(self._transitions.rebuild(self._names, values, lambda _: None))
        await self._while_alive(self._matching.complete(self.down))

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(process.spec.name for process in self.processes)

    async def first_death(self, among: Sequence[Member] = ()) -> Member:
        """Wait until a process ends, of some or of all; return it."""
        watched = tuple(among or self.processes)
        async with beside(*(process.ended() for process in watched)) as tasks:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        return watched[tasks.index(done.pop())]

    async def stop(self) -> None:
        """Stop every process: the active ones in order, the rig first, then the others at once."""
        for process in reversed(self.processes):
            if process.return_code is not None or process.spec.name not in self._active:
                continue
            await self._transitions.request(process.spec.name, DEACTIVATE, _FAREWELL_PATIENCE)
            await process.stop()
        await asyncio.gather(*(process.stop() for process in self.processes if process.started))

    async def kill(self) -> None:
        """End every process that is left, whatever state it is in."""
        for process in self.processes:
            if process.started:
                await process.kill()

    def _process(self, spec: NodeSpec, extra: Mapping[str, object] | None = None) -> Member:
        namespace = self.config.namespace
        values = {"use_sim_time": self.config.sim_time, **self.config.parameters.get(spec.name, {})}
        values |= extra or {}
        if self.config.attach:
            if self.config.parameters_file is not None:
                values = (
                    parameters_for(self.config.parameters_file, f"/{namespace}/{spec.name}")
                    | values
                )
            return AttachedNode(spec, self._transitions, values)
        return node_process(
            spec, namespace, self.config.log_directory, values, self.config.parameters_file
        )

    async def _reason(self, name: str) -> str:
        return await self.process(name).refusal(_REFUSAL_PATIENCE)

    def _killed(self, name: str) -> bool:
        return (self.process(name).return_code or 0) < 0

    def _work(self, name: str) -> object:
        """Return what changes while a node works, wherever it runs."""
        return self.process(name).work(), self._compiling(name)

    def _compiling(self, name: str) -> str:
        status = self.client.status(name)
        return status.values.get(COMPILING, "") if status else ""

    def _narrate(self) -> None:
        found = {name: share for name in self._names if (share := self._compiling(name))}
        sentence = ", ".join(f"{name} {share}" for name, share in found.items())
        if sentence and sentence != self._narrated:
            self._narrated = sentence
            self.report(f"compiling kernels (first start only): {sentence}")

    async def _configure_all(self) -> None:
        await asyncio.gather(*(configure(self._transitions, process) for process in self.processes))

    async def _while_alive(
        self, work: Coroutine[Any, Any, Any], among: Sequence[Member] = ()
    ) -> None:
        async with beside(work, self.first_death(among)) as (task, death):
            ended: set[asyncio.Task[Any]] = set()
            while not ended:
                ended, _ = await asyncio.wait(
                    {task, death}, timeout=_NARRATION_PERIOD, return_when=asyncio.FIRST_COMPLETED
                )
                self._narrate()
            if task.done():
                task.result()
                return
            dead: Member = death.result()
        # Its output may still be on its way through the pipe.
        await dead.stop()
        raise exit_error(dead)
