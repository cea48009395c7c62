"""Keeps the operator's page served beside a run, and after its failure."""

import asyncio
import contextlib
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from winding_core.run_options import COMPONENT, OperatorLimits
from winding_core.status import COMPONENT as RUN
from winding_core.status import Level, RunPhase
from winding_ros.client.async_client import AsyncClient
from winding_ros.graph import PAGE, GraphError
from winding_ros.runtime.heartbeat import Sign
from winding_supervisor.processes.beside import beside
from winding_supervisor.processes.members import exit_error
from winding_supervisor.processes.node_process import Backoff, NodeProcess, node_process
from winding_supervisor.watch.event_log import EventLog

# First starts on a busy machine.
_START_TIMEOUT = 120.0
_POLL = 0.1
# Twelve seconds without a sign of life: a busy machine is late, and nothing depends on the page.
_STALLS = 4
_REPORT_PERIOD = 1.0


@dataclass(frozen=True, kw_only=True)
class DashboardConfig:
    """The page's process."""

    parameters: Mapping[str, object]  # Of the node `dashboard`, with host and port
    namespace: str  # Of the graph
    log_directory: Path  # Folder of its output

    @property
    def address(self) -> tuple[str, int]:
        """Host and TCP port."""
        return str(self.parameters["host"]), int(str(self.parameters["port"]))

    @property
    def url(self) -> str:
        """What a browser is given."""
        host, port = self.address
        return f"http://{f'[{host}]' if ':' in host else host}:{port}/"


@dataclass(eq=False)
class DashboardProcess:
    """Starts the page's process, and starts it again when it ends or hangs.

    The machine is not stopped for it: the page is not the only stop, and a machine that stops
    whenever a web server does would lose runs for nothing.
    """

    config: DashboardConfig  # What to run
    client: AsyncClient  # The orchestrator's node
    log: EventLog  # Where events go
    clock: Callable[[], float]  # Simulated time [s], for the log

    def __post_init__(self) -> None:
        self._backoff = Backoff()
        self._misses = 0
        self._heard = False
        self._hung: asyncio.Queue[str] = asyncio.Queue()
        self._process = self._new()

    @property
    def limits(self) -> OperatorLimits | None:
        """The limits that its operator set last; None before the page has reported any."""
        status = self.client.status(f"{PAGE.name}: {COMPONENT}")
        return None if status is None else OperatorLimits.from_values(status.values)

    @property
    def pid(self) -> int:
        """Process id of the present page."""
        return self._process.pid

    async def start(self) -> None:
        """Start the page; return when it is served.

        Raises:
            GraphError: It ended before.
            TimeoutError: It does not answer.
        """
        self.client.watch(PAGE.name, self._note_sign)
        await self._process.start()
        await self._served()

    async def keep(self) -> None:
        """Keep the page served for as long as that can be done.

        Raises:
            GraphError: It failed for the fourth time within a minute; no operator could command
                the machine by it.
        """
        while True:
            failure = await self._failure()
            self._note("detected", failure)
            wait = self._backoff.next_wait(time.monotonic())
            if wait is None:
                sentence = f"{PAGE.name} {failure}, for the fourth time within a minute"
                self._note("ended", sentence)
                raise GraphError(sentence)
            await self._process.kill()
            await asyncio.sleep(wait)
            self._note("restarting", PAGE.policy.value)
            self._process = self._new()
            self._misses, self._heard = 0, False
            self._hung = asyncio.Queue()
            await self._process.start()
            self._note("restarted", "it is served again" if await self._comes() else "it ended")

    async def keep_until(self, ended: asyncio.Event) -> None:
        """Keep the page served until its operator ends it.

        Raises:
            GraphError: As in `keep`.
        """
        async with beside(self.keep(), ended.wait()) as (keeping, ending):
            await asyncio.wait({keeping, ending}, return_when=asyncio.FIRST_COMPLETED)
            if keeping.done():
                keeping.result()

    async def stop(self) -> None:
        """End the page, if it was started."""
        if self._process.started:
            await self._process.stop()

    async def kill(self) -> None:
        """End the page at once."""
        if self._process.started:
            await self._process.kill()

    def _new(self) -> NodeProcess:
        config = self.config
        set_on_page = {} if self.limits is None else vars(self.limits)
        parameters = {**config.parameters, **set_on_page}
        return node_process(PAGE, config.namespace, config.log_directory, parameters)

    async def _served(self) -> None:
        try:
            async with beside(self._process.ended()) as (ended,), asyncio.timeout(_START_TIMEOUT):
                while not await self._answers():
                    if ended.done():
                        raise exit_error(self._process)
                    await asyncio.sleep(_POLL)
        except TimeoutError:
            raise TimeoutError(f"no page at {self.config.url} in {_START_TIMEOUT:g} s") from None

    async def _comes(self) -> bool:
        """Return whether a page that was started again is served; `keep` deals with its end."""
        try:
            await self._served()
        except (GraphError, TimeoutError):
            return False
        return True

    async def _answers(self) -> bool:
        try:
            _, writer = await asyncio.open_connection(*self.config.address)
        except OSError:
            return False
        writer.close()
        with contextlib.suppress(OSError):
            await writer.wait_closed()
        return True

    async def _failure(self) -> str:
        """Wait until the process ends or hangs; return what became of it."""
        async with beside(self._process.ended(), self._hung.get()) as (ended, hung):
            await asyncio.wait({ended, hung}, return_when=asyncio.FIRST_COMPLETED)
            return f"ended with exit code {ended.result()}" if ended.done() else str(hung.result())

    def _note_sign(self, sign: Sign) -> None:
        if sign is Sign.ALIVE:
            self._misses, self._heard = 0, True
        elif not self._heard:
            # What is missed is its predecessor's; a page gives no sign of life before it is served.
            return
        elif sign is Sign.STALLED:
            self._misses += 1
            if self._misses >= _STALLS:
                self._hung.put_nowait(sign.value)
        elif self._process.started and self._process.return_code is None and self._process.stopped:
            self._hung.put_nowait(sign.value)

    def _note(self, what: str, text: str) -> None:
        self.log.note(what, PAGE.name, text, t=self.clock())


async def outlive(
    failure: str, page: DashboardProcess, client: AsyncClient, ended: asyncio.Event
) -> None:
    """Keep the page of a failed session served, and its failure in the diagnostics.

    Raises:
        GraphError: The page failed, too.
    """
    async with beside(_keep_reporting(failure, client)):
        await page.keep_until(ended)


async def _keep_reporting(failure: str, client: AsyncClient) -> None:
    sentence = f"the session cannot go on: {failure}"
    while True:
        client.report(0.0, Level.ERROR, RUN, sentence, {"phase": RunPhase.FAILED.value})
        await asyncio.sleep(_REPORT_PERIOD)
