"""One node's process: start, errors in its output, stop by INT, TERM, KILL, pauses of restarts."""

import asyncio
import collections
import os
import signal
import sys
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import psutil  # type: ignore[import-untyped]
import yaml

from winding_ros.environment import child_environment, enclave_arguments, ros_arguments
from winding_ros.graph import NodeSpec

_HELD = (psutil.STATUS_STOPPED, psutil.STATUS_TRACING_STOP)
# Processor time that counts as work [s]: a node that waits takes 0.5 % of a core, far less than
# this in any time for which one is waited for.
_WORK = 4.0
# On a busy computer a process may wait long for the processor, or for the disk.
_WAITING = (psutil.STATUS_RUNNING, psutil.STATUS_DISK_SLEEP)
# What ROS prints of a file of parameters that is not there.
_FILE, _UNPARSED = "--params-file", "Failed to parse global arguments"
_ERROR_MARKS = ("error:", "[ERROR]", "[FATAL]")
# A node that complains without end may not fill the disk: two files of this size [bytes].
LOG_LIMIT = 4_000_000
_CHUNK = 65_536
# What a line without an end is cut to [bytes].
_LINE_LIMIT = 8_192
_ESCALATION = ((signal.SIGINT, 5.0), (signal.SIGTERM, 2.0), (signal.SIGKILL, 5.0))


@dataclass(eq=False)
class NodeProcess:
    """A node in a process of its own, with its output in a file."""

    spec: NodeSpec  # Which node
    arguments: Sequence[str]  # Behind those of its command
    environment: Mapping[str, str]  # Of the process
    log: Path  # File of its output

    def __post_init__(self) -> None:
        self._complaints: collections.deque[str] = collections.deque(maxlen=200)
        self._complained = asyncio.Event()
        self._process: asyncio.subprocess.Process | None = None
        self._reader: asyncio.Task[None] | None = None
        self._wanting = False

    @property
    def pid(self) -> int:
        """Process id."""
        assert self._process is not None
        return self._process.pid

    @property
    def started(self) -> bool:
        """Whether there is a process to stop."""
        return self._process is not None

    @property
    def return_code(self) -> int | None:
        """Exit code, or None while it runs."""
        return None if self._process is None else self._process.returncode

    @property
    def stopped(self) -> bool:
        """Whether the process is held, as by SIGSTOP or a debugger."""
        try:
            return psutil.Process(self.pid).status() in _HELD
        except psutil.NoSuchProcess:
            return False

    @property
    def wants_processor(self) -> bool:
        """Whether the process runs, or waits for the processor or the disk."""
        try:
            return self.started and psutil.Process(self.pid).status() in _WAITING
        except psutil.NoSuchProcess:
            return False

    def work(self) -> object:
        """Return what changes from look to look while the process and its children work.

        That is their processor time, or that they want the processor at one look and the next.
        """
        if self._process is None:
            return None
        try:
            process = psutil.Process(self.pid)
            tree = [process, *process.children(recursive=True)]
            before, self._wanting = self._wanting, any(item.status() in _WAITING for item in tree)
            if before and self._wanting:
                return object()
            return int(sum(sum(item.cpu_times()[:4]) for item in tree) / _WORK)
        except psutil.NoSuchProcess:
            return None

    async def start(self) -> None:
        """Start the process in a session of its own: Ctrl-C reaches only the orchestrator."""
        self._process = await asyncio.create_subprocess_exec(
            sys.executable,
            *self.spec.command,
            *self.arguments,
            env=self.environment,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            start_new_session=True,
        )
        self._reader = asyncio.create_task(self._read())

    async def ended(self) -> int:
        """Wait for the process to end; return its exit code."""
        assert self._process is not None
        return await self._process.wait()

    async def kill(self) -> int:
        """End the process at once, whatever state it is in; return its exit code."""
        return await self.stop(_ESCALATION[-1:])

    async def stop(self, signals: Sequence[tuple[signal.Signals, float]] = _ESCALATION) -> int:
        """End the process, ever more firmly; return its exit code.

        Args:
            signals: Each with how long it is waited for before the next one is sent [s].
        """
        assert self._process is not None
        for number, patience in signals:
            if self._process.returncode is not None:
                break
            try:
                os.killpg(self._process.pid, number)
            except ProcessLookupError:
                break
            try:
                # wait_for of Python 3.11 loses a cancellation that comes with the answer.
                async with asyncio.timeout(patience):
                    await self._process.wait()
            except TimeoutError:
                continue
        if self._reader is not None:
            await self._reader
        return await self._process.wait()

    async def refusal(self, patience: float) -> str:
        """Return the error that the process has printed, waiting up to `patience` [s] for it."""
        try:
            async with asyncio.timeout(patience):
                await self._complained.wait()
        except TimeoutError:
            return "no reason given"
        return self.complaint()

    def complaint(self) -> str:
        """Return the last error that was printed; nothing of a process that was killed."""
        if self.return_code == -signal.SIGKILL:
            # What it printed had another cause.
            return ""
        if any(_UNPARSED in line for line in self._complaints):
            named = zip(self.arguments, self.arguments[1:], strict=False)
            files = [file for option, file in named if option == _FILE]
            if gone := [file for file in files if not Path(file).exists()]:
                return f"{gone[0]} is gone"
        errors = [line for line in self._complaints if line.startswith(_ERROR_MARKS)]
        if errors:
            return errors[-1].removeprefix("error: ").split("]: ", 1)[-1]
        return self._complaints[-1] if self._complaints else ""

    async def _read(self) -> None:
        assert self._process is not None
        assert self._process.stdout is not None
        file = self.log.open("ab")
        begun = b""
        try:
            while chunk := await self._process.stdout.read(_CHUNK):
                if file.tell() + len(chunk) > LOG_LIMIT:
                    file.close()
                    self.log.replace(self.log.with_suffix(".log.1"))
                    file = self.log.open("ab")
                file.write(chunk)
                file.flush()
                *lines, begun = (begun + chunk).split(b"\n")
                # A chunk may end within a line, and a line may have no end.
                begun = begun[:_LINE_LIMIT]
                for line in lines:
                    self._hear(line)
            self._hear(begun)
        finally:
            file.close()

    def _hear(self, line: bytes) -> None:
        text = line[:_LINE_LIMIT].decode(errors="replace").rstrip()
        if text:
            self._complaints.append(text)
        if text.startswith(_ERROR_MARKS):
            self._complained.set()


def node_process(
    spec: NodeSpec,
    namespace: str,
    log_directory: Path,
    parameters: Mapping[str, object],
    parameters_file: Path | None = None,
) -> NodeProcess:
    """Return the process of a node in a namespace, with its parameters in a file beside its log.

    Args:
        spec: Which node.
        namespace: Without slashes around it.
        log_directory: Folder of its output.
        parameters: By name; they go over those of the file.
        parameters_file: The user's, or None.
    """
    own = log_directory / f"{spec.name}.yaml"
    own.touch(mode=0o600)
    content = {f"/{namespace}/{spec.name}": {"ros__parameters": dict(parameters)}}
    own.write_text(yaml.safe_dump(content), encoding="utf-8")
    arguments = enclave_arguments(namespace, spec.name)
    arguments += ros_arguments(namespace) or ["--ros-args"]
    # The node's output is kept already, and kept short.
    arguments.append("--disable-external-lib-logs")
    for file in (parameters_file, own):
        if file is not None:
            arguments += [_FILE, str(file)]
    log = log_directory / f"{spec.name}.log"
    return NodeProcess(spec, arguments, child_environment(), log)


@dataclass(kw_only=True)
class Backoff:
    """Counts the restarts of one node."""

    limit: int = 3  # Restarts allowed within the window
    window: float = 60.0  # Wall time over which they count [s]
    first: float = 0.5  # Wait before the second restart [s]; it doubles with each further one
    _restarts: deque[float] = field(default_factory=deque)

    def next_wait(self, now: float) -> float | None:
        """Return how long to wait before a restart at `now` [s]; None when there were too many."""
        while self._restarts and now - self._restarts[0] > self.window:
            self._restarts.popleft()
        count = len(self._restarts)
        if count >= self.limit:
            return None
        self._restarts.append(now)
        return 0.0 if count == 0 else self.first * 2.0 ** (count - 1)
