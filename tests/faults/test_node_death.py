"""Interrupted twice at any moment, or without a supervisor: nothing is left behind."""

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
import pytest

from processes import COMMAND, in_namespace, ran, until
from winding_ros.graph import DEFAULT_NAMESPACE
from winding_ros.runtime.process import SUPERVISED
from winding_supervisor.session.domain_lock import DomainError, domain_lock

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.timeout(900)]

PATIENCE = 600.0
APART = 0.3  # Between two signals [s]
# What can be seen of each stage, and how long after that the first signal comes at most [s]. While
# the interpreter itself starts, no line of the command has run and nothing is open: the first
# moment is the one from which the command takes signals.
STAGES = {"starting": 1.5, "configuring": 3.0, "winding": 2.0, "reporting": 1.0}
DOMAIN = int(os.environ["ROS_DOMAIN_ID"])


class Run:
    """A recorded `winding run` in the background, in a folder of its own, its output in a file."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder, self.run, self.bag = folder, folder / "run", folder / "bag"
        self._output = folder / "output"
        self._children: set[psutil.Process] = set()
        with self._output.open("w") as output:
            self.process = subprocess.Popen(
                [
                    *(*COMMAND, "run", "--case", "4", *options),
                    *("--output", str(self.run), "--bag", str(self.bag)),
                ],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )

    def printed(self) -> str:
        return self._output.read_text(encoding="utf-8")

    def reached(self, stage: str) -> bool:
        """Return whether a stage has begun, as far as its files show it."""
        if stage == "starting":
            status = Path(f"/proc/{self.process.pid}/status").read_text()
            taken = next(line for line in status.splitlines() if line.startswith("SigCgt:"))
            return bool(int(taken.split()[1], 16) >> (signal.SIGTERM - 1) & 1)
        if stage == "configuring":
            return len(list((self.run / "log").glob("*.log"))) == 4
        return {"winding": " simulated, ", "reporting": "3.00 of 3.00 s simulated"}[
            stage
        ] in self.printed()

    def wait_for(self, stage: str) -> None:
        """Wait until a stage has begun, or the run is over."""
        until(lambda: self.process.poll() is not None or self.reached(stage), PATIENCE)

    def send(self, number: int, *, group: bool) -> None:
        """Send a signal to the command, or to its process group as a terminal does."""
        if self.process.poll() is None:
            self._children |= set(psutil.Process(self.process.pid).children(recursive=True))
            (os.killpg if group else os.kill)(self.process.pid, number)

    def processes(self) -> list[psutil.Process]:
        """Return what lives and is a child of this run, or has its folder in the command line."""
        return [
            process
            for process in {*self._children, *psutil.process_iter()}
            if process.pid != self.process.pid
            and (process in self._children or any(str(self.folder) in w for w in words(process)))
            and alive(process)
        ]

    def left_behind(self) -> list[str]:
        """Return what is wrong with how it ended, one sentence each."""
        code, printed = self.process.returncode, self.printed()
        summary = self.run / "run.json"
        found = []
        if code != 130 and not (code == 0 and summary.exists()):
            found.append(f"exit code {code}")
        sentences = [line for line in printed.splitlines() if "interrupted" in line]
        if len(sentences) > 1 or (code == 130 and not sentences):
            found.append(f"{len(sentences)} sentences")
        unwanted = ("Traceback", "Exception ignored", "Error:", "[ERROR]")
        found += [f"prints {word}" for word in unwanted if word in printed]
        if processes := self.processes():
            found.append(f"processes left: {processes}")
        try:
            with domain_lock(DOMAIN, DEFAULT_NAMESPACE):
                pass
        except DomainError:
            found.append("the domain is locked")
        names = [path.name for path in self.folder.rglob("*")]
        found += [f"file left: {name}" for name in names if name.endswith((".unfinished", ".tmp"))]
        if ".reserve" in names:
            found.append("the bag was not closed")
        if summary.exists() and not summary.read_text().endswith("}\n"):
            found.append("run.json is not whole")
        return found


def words(process: psutil.Process) -> list[str]:
    """Return the command line of a process; nothing for one that has gone."""
    try:
        return process.cmdline()
    except psutil.Error:
        return []


def alive(process: psutil.Process) -> bool:
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False


def interrupted_twice(times: int) -> list[str]:
    """Interrupt runs twice at random moments of every stage; return what they left behind."""
    draw = random.Random(1)
    ways = [(signal.SIGTERM, False), (signal.SIGINT, True), (signal.SIGINT, False)]
    found = []
    for stage, longest in STAGES.items():
        for k in range(times):
            number, group = ways[k % len(ways)]
            # Paths are printed, too: none of them contains the word that is counted.
            with tempfile.TemporaryDirectory(prefix="winding-broken-off-") as folder:
                run = Run(
                    Path(folder), "--duration-s", "3", "--speed", "0", "--domain", f"{DOMAIN}"
                )
                run.wait_for(stage)
                time.sleep(draw.uniform(0.0, longest))
                run.send(number, group=group)
                time.sleep(APART)
                run.send(number, group=group)
                try:
                    run.process.wait(PATIENCE)
                    wrong = run.left_behind()
                except subprocess.TimeoutExpired:
                    run.process.kill()
                    run.process.wait()
                    wrong = ["it hung"]
                if wrong:
                    print(run.printed(), flush=True)
                found += [f"{stage}, {number.name}: {fault}" for fault in wrong]
    return found


def test_run_that_is_interrupted_twice_leaves_nothing_behind() -> None:
    assert interrupted_twice(times=1) == []


@pytest.mark.soak
@pytest.mark.timeout(7200)
def test_run_that_is_interrupted_twice_at_any_moment_leaves_nothing_behind() -> None:
    assert interrupted_twice(times=30) == []


def test_node_ends_when_its_supervisor_died_while_it_started(tmp_path: Path) -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    words = (sys.executable, "-m", "correction_node", *in_namespace("orphan"))
    own = {**os.environ, SUPERVISED: str(gone.pid)}
    assert ran(*words, cwd=tmp_path, env=own, timeout=PATIENCE).returncode == 0
