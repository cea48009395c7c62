"""Interrupt `winding run` twice at random moments and look at what it leaves.

`python tests/faults/interrupted_run.py --times 10` prints one line per run and the counts; it
exits with 1 when any run left something behind. While the interpreter itself starts, no line of the
command has run and nothing is open: the first moment is the one from which the command takes
signals.
"""

from __future__ import annotations

import argparse
import collections
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from winding_ros.graph import DEFAULT_NAMESPACE
from winding_supervisor.session.domain_lock import DomainError, domain_lock

PATIENCE = 600.0
POLL = 0.005
APART = 0.3
# What can be seen of each stage, and how long after that the first signal comes at most [s].
STAGES = {"starting": 1.5, "configuring": 3.0, "winding": 2.0, "reporting": 1.0}


@dataclass
class Interrupted:
    """One run of the command in a folder of its own, with its output in files."""

    folder: Path
    domain: int
    children: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.run = self.folder / "run"
        self.stdout, self.stderr = self.folder / "stdout", self.folder / "stderr"
        with self.stdout.open("w") as out, self.stderr.open("w") as err:
            self.process = subprocess.Popen(
                [
                    *(sys.executable, "-m", "winding_cli.cli", "run", "--case", "4"),
                    *("--duration-s", "3", "--speed", "0", "--domain", str(self.domain)),
                    *("--output", str(self.run), "--bag", str(self.folder / "bag")),
                ],
                cwd=self.folder,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                start_new_session=True,
            )

    def said(self) -> str:
        """Return everything that was printed."""
        return self.stdout.read_text() + self.stderr.read_text()

    def reached(self, stage: str) -> bool:
        """Return whether a stage has begun, as far as its files tell."""
        if stage == "starting":
            status = Path(f"/proc/{self.process.pid}/status").read_text()
            taken = next(line for line in status.splitlines() if line.startswith("SigCgt:"))
            return bool(int(taken.split()[1], 16) >> (signal.SIGTERM - 1) & 1)
        if stage == "configuring":
            return len(list((self.run / "log").glob("*.log"))) == 4
        if stage == "winding":
            return " simulated, " in self.said()
        return "3.00 of 3.00 s simulated" in self.said()

    def wait_for(self, stage: str) -> None:
        """Wait until a stage has begun, or the run is over."""
        until(lambda: self.process.poll() is not None or self.reached(stage))

    def send(self, number: int, *, group: bool) -> None:
        """Send a signal to the command, or to its process group as a terminal does."""
        if self.process.poll() is None:
            self.note_children()
            if group:
                os.killpg(self.process.pid, number)
            else:
                self.process.send_signal(number)

    def note_children(self) -> None:
        """Remember which processes the command has started."""
        try:
            found = psutil.Process(self.process.pid).children(recursive=True)
        except psutil.NoSuchProcess:
            return
        self.children |= {child.pid for child in found}

    def faults(self) -> list[str]:
        """Return what is wrong with how it ended, one sentence each."""
        code, said = self.process.returncode, self.said()
        over = code == 0 and (self.run / "run.json").exists()
        found = [] if code == 130 or over else [f"exit code {code}"]
        sentences = [line for line in said.splitlines() if "interrupted" in line]
        if len(sentences) > 1:
            found.append(f"{len(sentences)} sentences")
        if code == 130 and not sentences:
            found.append("no sentence")
        for word in ("Traceback", "Exception ignored", "Error:", "[ERROR]"):
            if word in said:
                found.append(f"says {word}")
        left = [pid for pid in self.children if psutil.pid_exists(pid) and ours(pid)]
        left += [process.pid for process in psutil.process_iter() if self.belongs(process)]
        if left:
            found.append(f"processes left: {left}")
        try:
            with domain_lock(self.domain, DEFAULT_NAMESPACE):
                pass
        except DomainError:
            found.append("the domain is locked")
        names = [path.name for path in self.folder.rglob("*")]
        found += [f"file left: {name}" for name in names if name.endswith((".unfinished", ".tmp"))]
        if ".reserve" in names:
            found.append("the bag was not closed")
        if (self.run / "run.json").exists() and not (self.run / "run.json").read_text().endswith(
            "}\n"
        ):
            found.append("run.json is not whole")
        return found

    def belongs(self, process: psutil.Process) -> bool:
        """Return whether a process was started by this run."""
        try:
            return any(str(self.folder) in word for word in process.cmdline())
        except psutil.Error:
            return False


def ours(pid: int) -> bool:
    """Return whether a process is Python's and alive, not another's with its number."""
    try:
        process = psutil.Process(pid)
        return process.status() != psutil.STATUS_ZOMBIE and "python" in process.name()
    except psutil.Error:
        return False


def until(reached: Callable[[], bool], patience: float = PATIENCE) -> None:
    """Wait for something, for up to `patience` [s]."""
    end = time.monotonic() + patience
    while not reached() and time.monotonic() < end:
        time.sleep(POLL)


def interrupt(stage: str, number: int, *, group: bool, delay: float, domain: int) -> list[str]:
    """Run, wait for a stage, send a signal twice, return what is wrong afterwards."""
    with tempfile.TemporaryDirectory(prefix="winding-interrupted-") as folder:
        run = Interrupted(Path(folder), domain)
        run.wait_for(stage)
        time.sleep(delay)
        begin = time.monotonic()
        run.send(number, group=group)
        time.sleep(APART)
        run.send(number, group=group)
        try:
            run.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            run.process.kill()
            run.process.wait()
            return ["it hung"]
        took = time.monotonic() - begin
        faults = run.faults()
        print(
            f"{stage:12s} {signal.Signals(number).name:8s} {'group' if group else 'alone'} "
            f"at +{delay:.2f} s: exit {run.process.returncode:4d} after {took:5.2f} s  "
            f"{'; '.join(faults) or 'clean'}",
            flush=True,
        )
        if faults:
            print(run.said(), flush=True)
        return faults


def main() -> int:
    """Interrupt every stage so many times by each way; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=10)
    parser.add_argument("--stage", choices=tuple(STAGES))
    parser.add_argument("--domain", type=int, default=97)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--ways", default="TERM,INT,INT-group")
    options = parser.parse_args()
    draw = random.Random(options.seed)
    counts: collections.Counter[str] = collections.Counter()
    for stage in [options.stage] if options.stage else STAGES:
        for way in options.ways.split(","):
            for _ in range(options.times):
                faults = interrupt(
                    stage,
                    signal.SIGTERM if way == "TERM" else signal.SIGINT,
                    group=way.endswith("group"),
                    delay=draw.uniform(0.0, STAGES[stage]),
                    domain=options.domain,
                )
                counts[f"{stage} {way}: {'clean' if not faults else 'FAILED'}"] += 1
    for name, count in sorted(counts.items()):
        print(f"{name} {count}")
    return int(any("FAILED" in name for name in counts))


if __name__ == "__main__":
    # A job in the background of a shell ignores SIGINT, and so would what it starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(main())
