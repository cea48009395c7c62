"""One run in processes of its own, the faults that are put into it, and what an observer saw."""

import asyncio
import contextlib
import json
import os
import re
import resource
import shutil
import signal
import sys
import time
from contextlib import AsyncExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import psutil  # type: ignore[import-untyped]

from winding_core.run_outcome import Event
from winding_ros.environment import child_environment
from winding_supervisor.watch.event_log import read_events
from winding_verification.faults import external_node, foreign_driver, observer

CASE = 4
# A start, a run, and everything that a run waits for in its end [s].
PATIENCE = 240.0
_POLL = 0.01
# The last words of a command that has ended are read within [s].
_READ = 5.0
_PIPE = asyncio.subprocess.PIPE
_NULL = asyncio.subprocess.DEVNULL
# No file of a command whose disk is full grows beyond [bytes].
_FULL = 200_000
_CONNECTIONS = 400


class TrialError(RuntimeError):
    """A run did not reach a state in which it could be tried."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """Something that is done to a run."""

    at: float  # After the machine's first motion, or after the command's start if negative [s]
    what: str  # Such as `kill cable_fem`; the first word chooses the method of `Trial`

    def __str__(self) -> str:
        return f"{self.what} {'in' if self.at < 0.0 else 'at'} {abs(self.at):.2f} s"


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A run that is to be tried."""

    name: str  # Of its row, or `seed.number`
    faults: tuple[Fault, ...] = ()  # In their order
    foreign: bool = False  # Whether the machine is the driver of examples/
    options: tuple[str, ...] = ()  # Of `winding run`, further ones
    duration: float = 3.0  # Of the winding [s]

    @property
    def put_in(self) -> str:
        """The faults in words."""
        return "; ".join(map(str, self.faults)) or "nothing"


@dataclass(kw_only=True)
class Account:
    """What an observer saw of a run, and what the run left."""

    code: int | None = None  # The command's exit code; None where it hung
    printed: str = ""  # On its terminal
    run: dict[str, Any] | None = None  # run.json; None where there is none
    events: list[Event] = field(default_factory=list)  # That supervision noted
    seen: dict[str, Any] = field(default_factory=dict)  # The observer's account
    answers: list[str] = field(default_factory=list)  # Of what was put in, a line each
    orphans: list[str] = field(default_factory=list)  # Processes that were left


class Trial:
    """Runs a plan.

    Args:
        plan: What.
        folder: New folder of the run.
        namespace: Of the graph, which no other trial has.
        driver: File of the driver of a foreign machine.
    """

    def __init__(self, plan: Plan, folder: Path, namespace: str, driver: Path) -> None:
        self.plan, self.folder, self.namespace, self._driver_file = plan, folder, namespace, driver
        self.account = Account()
        self._lines: list[str] = []
        self._children: set[psutil.Process] = set()
        self._stack = AsyncExitStack()
        self._began = 0.0
        self._moved: asyncio.Future[float] = asyncio.get_running_loop().create_future()
        self._run: asyncio.subprocess.Process
        self._observer: asyncio.subprocess.Process
        self._driver: asyncio.subprocess.Process | None = None

    async def conduct(self) -> Account:
        """Run the command to its end; return what became of it."""
        self.folder.mkdir(parents=True)
        async with self._stack:
            place = ("--ros-args", "-r", f"__ns:=/{self.namespace}")
            self._observer = await self._python("-m", observer.__name__, *place)
            await self._line(self._observer, "ready")
            if self.plan.foreign:
                script = ("-m", foreign_driver.__name__, str(self._driver_file))
                self._driver = await self._python(*script, *place)
                await self._line(self._driver, "ready")
            self._run = await self._python(
                *("-m", "winding_cli.cli", "run", "--case", str(CASE)),
                *("--namespace", self.namespace, "--output", str(self.folder / "run")),
                *self._options(),
                supervised=False,
            )
            self._began = time.monotonic()
            beside = [
                asyncio.create_task(work)
                for work in (self._read(), self._watch_children(), self._note_motion())
            ]
            putting_in = asyncio.create_task(self._put_in())
            try:
                async with asyncio.timeout(PATIENCE):
                    self.account.code = await self._run.wait()
            except TimeoutError:
                self.account.code = None
            try:
                # The observer sees the machine as the command has left it.
                self.account.seen = json.loads(await self._ask_observer(beside[2]))
                self.account.orphans = self._left()
                await asyncio.wait({beside[0]}, timeout=_READ)
                if any(fault.what.startswith("again") for fault in self.plan.faults):
                    await putting_in
                if putting_in.done():
                    putting_in.result()
            finally:
                for task in (*beside, putting_in):
                    task.cancel()
                await asyncio.gather(*beside, putting_in, return_exceptions=True)
        self._collect()
        return self.account

    def _options(self) -> list[str]:
        plan = self.plan
        words = ["--duration-s", f"{plan.duration:g}", *plan.options]
        if plan.foreign:
            return ["--machine", "external", "--no-camera", "--standing-s", "2", *words]
        file = self.folder / "faults.yaml"
        file.write_text("/**/winding_rig:\n  ros__parameters:\n    inject_faults: true\n")
        return ["--parameters", str(file), *words]

    async def _python(self, *words: str, supervised: bool = True) -> asyncio.subprocess.Process:
        """Start a process of Python that is killed with this trial."""
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            *words,
            cwd=self.folder,
            env=child_environment() if supervised else None,
            stdin=_PIPE if supervised else _NULL,
            stdout=_PIPE,
            stderr=None if supervised else asyncio.subprocess.STDOUT,
            start_new_session=not supervised,
            # A shell's background commands ignore it, and so would this one.
            preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
            limit=2**22,
        )

        async def end() -> None:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()

        self._stack.push_async_callback(end)
        return process

    async def _line(self, process: asyncio.subprocess.Process, wanted: str = "") -> str:
        """Return the next line of a process that begins as wanted."""
        assert process.stdout is not None
        async with asyncio.timeout(PATIENCE):
            while data := await process.stdout.readline():
                line = data.decode().strip()
                if line.startswith(wanted):
                    return line
        raise TrialError(f"a process ended before its line {wanted!r}")

    async def _read(self) -> None:
        assert self._run.stdout is not None
        while data := await self._run.stdout.readline():
            self._lines.append(data.decode(errors="replace"))

    async def _watch_children(self) -> None:
        while True:
            with contextlib.suppress(psutil.Error):
                self._children |= set(psutil.Process(self._run.pid).children(recursive=True))
            await asyncio.sleep(0.1)

    async def _note_motion(self) -> None:
        await self._line(self._observer, "moves")
        self._moved.set_result(time.monotonic())

    async def _ask_observer(self, listening: asyncio.Task[None]) -> str:
        listening.cancel()
        await asyncio.wait({listening})
        self._note("ended")
        return await self._line(self._observer, "{")

    def _note(self, words: str) -> None:
        assert self._observer.stdin is not None
        self._observer.stdin.write(f"{words}\n".encode())

    def _left(self) -> list[str]:
        """Kill what the command has left; return its names."""
        found = []
        for child in self._children:
            with contextlib.suppress(psutil.Error):
                if child.is_running() and child.status() != psutil.STATUS_ZOMBIE:
                    found.append(" ".join(child.cmdline()[:4]))
                    child.kill()
        return found

    def _collect(self) -> None:
        account = self.account
        account.printed = "".join(self._lines)
        (self.folder / "terminal.txt").write_text(account.printed, encoding="utf-8")
        self._take_numbers()
        # A full disk has its numbers elsewhere.
        for name in re.findall(r"numbers: (\S*/winding-run-\S+)", account.printed):
            self._take_numbers(Path(name))
            shutil.rmtree(Path(name).parent, ignore_errors=True)
        # Its last line may be cut where the disk was full.
        with contextlib.suppress(ValueError):
            account.events = read_events(self.folder / "run" / "events.jsonl")

    def _take_numbers(self, file: Path | None = None) -> None:
        """Keep a run.json, that of the run's folder if none is named, where there is one."""
        file = file or self.folder / "run" / "run.json"
        if file.is_file():
            self.account.run = json.loads(file.read_text(encoding="utf-8"))

    async def _put_in(self) -> None:
        """Put every fault in when its time has come; whether one before it has ended or not."""
        async with asyncio.TaskGroup() as group:
            for fault in self.plan.faults:
                group.create_task(self._put(fault))

    async def _put(self, fault: Fault) -> None:
        word, _, rest = fault.what.partition(" ")
        put = getattr(self, f"_{word}")
        if word == "role":
            # A process has to start before it can play one.
            put = partial(self._role, player=await self._player(rest))
        begin = self._began if fault.at < 0.0 else await asyncio.shield(self._moved)
        await asyncio.sleep(max(0.0, begin + abs(fault.at) - time.monotonic()))
        self._note(fault.what)
        await put(rest)

    def _pids(self, name: str) -> list[int]:
        """Return the processes of a name: a node, `orchestrator` or `driver`."""
        if name == "orchestrator":
            return [self._run.pid]
        if name == "driver":
            return [self._driver.pid] if self._driver is not None else []
        found = []
        with contextlib.suppress(psutil.Error):
            self._children |= set(psutil.Process(self._run.pid).children())
        for child in self._children:
            with contextlib.suppress(psutil.Error):
                words = " ".join(child.cmdline())
                if name in words and child.status() != psutil.STATUS_ZOMBIE:
                    found.append(child.pid)
        return found

    def _send(self, name: str, number: signal.Signals) -> None:
        for pid in self._pids(name):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, number)

    async def _kill(self, names: str) -> None:
        for name in names.split():
            self._send(name, signal.SIGKILL)

    async def _hold(self, rest: str) -> None:
        """Hold a process, for some seconds if they are given."""
        name, _, seconds = rest.partition(" ")
        pids = self._pids(name)
        self._send(name, signal.SIGSTOP)
        if seconds:
            await asyncio.sleep(float(seconds))
            for pid in pids:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGCONT)

    async def _machine(self, words: str) -> None:
        """Let the foreign machine do something of its own."""
        assert self._driver is not None
        assert self._driver.stdin is not None
        self._driver.stdin.write(f"{words}\n".encode())

    async def _disk(self, _: str) -> None:
        """Let no file of the command grow beyond a few kilobytes."""
        with contextlib.suppress(psutil.Error):
            psutil.Process(self._run.pid).rlimit(resource.RLIMIT_FSIZE, (_FULL, _FULL))

    async def _remove(self, _: str) -> None:
        # What the run had written by then is lost through this fault, not by the run.
        self._take_numbers()
        shutil.rmtree(self.folder / "run", ignore_errors=True)

    async def _signal(self, names: str) -> None:
        """Send signals to the command, a third of a second apart."""
        for name in names.split():
            with contextlib.suppress(ProcessLookupError):
                self._run.send_signal(signal.Signals[f"SIG{name}"])
            await asyncio.sleep(0.3)

    async def _player(self, words: str) -> asyncio.subprocess.Process:
        """Return a process from outside the graph that waits to play a role."""
        return await self._python("-m", external_node.__name__, self.namespace, *words.split())

    async def _role(self, words: str, player: asyncio.subprocess.Process | None = None) -> None:
        """Let a process from outside the graph play a role; keep the line that it reports."""
        player = player or await self._player(words)
        assert player.stdin is not None
        player.stdin.write(b"play\n")
        self.account.answers.append(await self._line(player))

    async def _again(self, rest: str) -> None:
        """Run another graph, in this namespace or in another; keep how it ended."""
        process = await self._python(
            *("-m", "winding_cli.cli", "run", "--case", str(CASE), "--duration-s", "1"),
            *("--namespace", self.namespace if rest == "here" else f"{self.namespace}b"),
            *("--output", str(self.folder / f"again-{rest}")),
            supervised=False,
        )
        printed, _ = await asyncio.wait_for(process.communicate(), PATIENCE)
        last = printed.decode().strip().splitlines()[-1:]
        self.account.answers.append(f"exit code {process.returncode}: {''.join(last)}")

    async def _successor(self, name: str) -> None:
        """Kill a node and hold its successor while it starts."""
        lost = self._pids(name)
        await self._kill(name)
        while not (found := [pid for pid in self._pids(name) if pid not in lost]):
            await asyncio.sleep(_POLL)
        os.kill(found[0], signal.SIGSTOP)

    async def _whenever(self, name: str) -> None:
        """Kill a node whenever there is another one of it."""
        while True:
            await self._kill(name)
            await asyncio.sleep(0.1)

    async def _start(self, _: str) -> None:
        """Press Start of the operator's page as soon as it is served."""
        while "operator's page: " not in "".join(self._lines):
            await asyncio.sleep(_POLL)
        await self._role("call rig/start")

    async def _hear(self, _: str) -> None:
        """Keep the outcome that the page is given, and end the session then."""
        await self._role("outcome")
        self._run.send_signal(signal.SIGINT)

    async def _flood(self, _: str) -> None:
        """Open connections to the page that ask for nothing; they stay open."""
        (line,) = (line for line in self._lines if "operator's page: " in line)
        port = int(line.partition("127.0.0.1:")[2].partition("/")[0].partition("?")[0])
        for _connection in range(_CONNECTIONS):
            with contextlib.suppress(OSError):
                _reader, writer = await asyncio.open_connection("127.0.0.1", port)
                writer.write(b"GET / HTTP/1.1\r\n")
                self._stack.callback(writer.close)
