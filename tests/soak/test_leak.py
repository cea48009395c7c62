"""Half an hour of the whole graph: memory, shared memory and logs stay what they are; --run-soak.

SOAK_MINUTES makes it shorter or longer.
"""

import os
import statistics
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path

import psutil
import pytest

pytestmark = [
    pytest.mark.soak,
    pytest.mark.processes,
    pytest.mark.slow,
]

NAMESPACE = "soak"
MINUTES = float(os.environ.get("SOAK_MINUTES", "30"))
LOOK_S = 5.0
# What is there after two minutes of winding may grow by so much.
SETTLED_S = 120.0
GROWTH = 1.02
# Logs name what goes wrong and what begins; nothing of that comes with every run.
LOG_GROWTH = 64_000
# Starting processes and the first run, on a machine that does other things.
PATIENCE = 300.0


class Soak:
    """The graph in a process of its own, looked at from outside."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._output = folder / "output"
        words = ("-m", "winding_cli.cli", "run", "--case", "4", "--dashboard", "--duration-s", "20")
        place = ("--speed", "0", "--namespace", NAMESPACE, "--output", str(folder / "run"))
        operator = (str(Path(__file__).with_name("wind_on.py")), NAMESPACE, str(MINUTES))
        with self._output.open("w") as output:
            self._process, self._operator = (
                subprocess.Popen(
                    [sys.executable, *command], stdout=output, stderr=subprocess.STDOUT
                )
                for command in ((*words, *place), operator)
            )
        self._root = psutil.Process(self._process.pid)

    @property
    def printed(self) -> str:
        return self._output.read_text(encoding="utf-8")

    def wait_until_it_winds(self) -> None:
        end = time.monotonic() + PATIENCE
        while "winding\n" not in self.printed:
            assert self.goes_on(0.1), self.printed
            assert time.monotonic() < end, self.printed

    def goes_on(self, wait: float) -> bool:
        """Wait so many seconds; return whether the process has not ended meanwhile."""
        try:
            self._operator.wait(wait)
        except subprocess.TimeoutExpired:
            return self._process.poll() is None
        return False

    @property
    def exit_code(self) -> int | None:
        return self._process.returncode

    def memory(self) -> dict[str, int]:
        """Return the resident memory of every process of the graph [bytes]."""
        found = {"orchestrator": self._root.memory_info().rss}
        for child in self._root.children():
            words = child.cmdline()
            if "-m" in words:
                found[words[words.index("-m") + 1]] = child.memory_info().rss
        return found

    def shared(self) -> tuple[int, int]:
        """Return number and size [bytes] of the files in shared memory that the graph has open."""
        files: dict[str, int] = {}
        for process in (self._root, *self._root.children()):
            for line in Path(f"/proc/{process.pid}/maps").read_text(encoding="utf-8").splitlines():
                path = line.partition("/dev/shm/")[2]
                if path and not path.endswith("(deleted)"):
                    files[path] = Path("/dev/shm", path).stat().st_size
        return len(files), sum(files.values())

    def logs(self) -> tuple[int, int]:
        """Return number and size [bytes] of the session's logs."""
        sizes = [
            path.stat().st_size
            for path in (self._folder / "run" / "log").rglob("*")
            if path.is_file()
        ]
        return len(sizes), sum(sizes)

    def end(self) -> None:
        self._operator.kill()
        self._operator.wait()
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(60.0)
            except subprocess.TimeoutExpired:
                self._process.kill()


@pytest.mark.timeout(60.0 * MINUTES + 600.0)
def test_nothing_grows_while_the_graph_winds(tmp_path: Path) -> None:
    soak = Soak(tmp_path)
    try:
        soak.wait_until_it_winds()
        begin = time.monotonic()
        memory: dict[str, list[tuple[float, int]]] = defaultdict(list)
        files: list[tuple[tuple[int, int], tuple[int, int]]] = []
        while soak.goes_on(LOOK_S) and time.monotonic() - begin < 60.0 * MINUTES:
            passed = time.monotonic() - begin
            for name, used in soak.memory().items():
                memory[name].append((passed, used))
            if passed >= SETTLED_S:
                files.append((soak.shared(), soak.logs()))
        assert soak.exit_code in (0, None), soak.printed
    finally:
        soak.end()
    runs = soak.printed.count("a run is over")
    print(f"{(time.monotonic() - begin) / 60.0:.1f} min of winding, {runs} runs")
    grown = {}
    for name, looks in memory.items():
        settled = statistics.median(u for t, u in looks if SETTLED_S <= t < SETTLED_S + 30.0)
        # The end of a run takes what the next one takes again; one look may fall upon it.
        last = statistics.median(u for t, u in looks[-6:])
        grown[name] = last / settled
        print(f"{name}: {settled / 1e6:.1f} MB after two minutes, {last / 1e6:.1f} MB at the end")
    (shared, logs), (shared_last, logs_last) = files[0], files[-1]
    print(f"shared memory: {shared[0]} files of {shared[1] / 1e6:.1f} MB, then {shared_last[0]} of")
    print(f"{shared_last[1] / 1e6:.1f} MB; logs: {logs[0]} files of {logs[1]} B, then {logs_last}")
    assert runs > MINUTES, soak.printed
    assert len(grown) == 6
    assert max(grown.values()) <= GROWTH, grown
    assert shared_last[0] <= shared[0]
    assert shared_last[1] <= shared[1]
    assert logs_last[0] <= logs[0]
    assert logs_last[1] <= logs[1] + LOG_GROWTH
