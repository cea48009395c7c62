"""Half an hour of the whole graph and its page: memory, shared memory and logs stay; --run-soak.

A browser on the operator's page begins run after run. SOAK_MINUTES makes it shorter or longer.
"""

import os
import statistics
import subprocess
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
from browser_tab import Tab
from chromium import chromium

from processes import COMMAND, free_port, until

pytestmark = [pytest.mark.soak, pytest.mark.processes, pytest.mark.slow]

NAMESPACE = "soak"
MINUTES = float(os.environ.get("SOAK_MINUTES", "30"))
LOOK_S = 5.0
# What is there after two minutes of winding may grow by so much.
SETTLED_S = 120.0
GROWTH = 1.02
# Logs name what goes wrong and what begins; nothing of that comes with every run.
LOG_GROWTH = 64_000
PATIENCE = 300.0  # Starting processes and the first run, on a machine that does other things


class Soak:
    """The graph in a process of its own, looked at from outside."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._output = folder / "output"
        port = free_port()
        self.url = f"http://127.0.0.1:{port}/"
        words = ("run", "--case", "4", "--dashboard", "--dashboard-port", str(port))
        place = ("--duration-s", "20", "--speed", "0", "--namespace", NAMESPACE)
        with self._output.open("w") as output:
            self._process = subprocess.Popen(
                [*COMMAND, *words, *place, "--output", folder / "run"],
                stdout=output,
                stderr=subprocess.STDOUT,
            )
        self._root = psutil.Process(self._process.pid)

    @property
    def printed(self) -> str:
        return self._output.read_text(encoding="utf-8")

    def until(self, reached: Callable[[], bool]) -> None:
        until(reached, PATIENCE, self._process)

    @property
    def exit_code(self) -> int | None:
        return self._process.poll()

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
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(60.0)
            except subprocess.TimeoutExpired:
                self._process.kill()


def phase_of(tab: Tab) -> str:
    word = tab.measured("document.querySelector('[data-part=state] .word')?.innerText")
    return (word or "").lower()


def wind_on(tab: Tab) -> int:
    """Begin another run if the last one is over; return how many were over."""
    phase = phase_of(tab)
    if phase == "finished":
        tab.button("Reset").click()
        tab.answer("Reset")
        tab.answered("start of a run")
        return 1
    if phase in ("ready", "stopped") and tab.button("Start").is_enabled():
        tab.button("Start").click()
    return 0


@pytest.mark.timeout(60.0 * MINUTES + 600.0)
def test_nothing_grows_while_the_graph_winds(tmp_path: Path) -> None:
    soak, runs = Soak(tmp_path), 0
    memory: dict[str, list[tuple[float, int]]] = defaultdict(list)
    files: list[tuple[tuple[int, int], tuple[int, int]]] = []
    try:
        soak.until(lambda: "operator's page" in soak.printed)
        with chromium() as browser:
            tab = Tab(browser, (1280, 800))
            tab.page.goto(soak.url)
            soak.until(lambda: phase_of(tab) == "ready")
            begin = looked = time.monotonic()
            while (now := time.monotonic()) - begin < 60.0 * MINUTES and soak.exit_code is None:
                runs += wind_on(tab)
                tab.page.wait_for_timeout(500)
                if now - looked < LOOK_S:
                    continue
                looked, passed = now, now - begin
                for name, used in soak.memory().items():
                    memory[name].append((passed, used))
                if passed >= SETTLED_S:
                    files.append((soak.shared(), soak.logs()))
            assert tab.complaints == []
        assert soak.exit_code is None, soak.printed
    finally:
        soak.end()
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
