"""`winding run --dashboard` in a process of its own, for the browsers of the tests."""

import contextlib
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil

from processes import COMMAND, PATIENCE, free_port

NAMESPACE = "attended"


@dataclass(frozen=True, kw_only=True)
class AttendedRun:
    """The command, its folder and its page."""

    url: str
    folder: Path
    process: "subprocess.Popen[str]"

    def page(self) -> psutil.Process | None:
        for child in psutil.Process(self.process.pid).children():
            # One that was killed a moment ago has no command line any more.
            with contextlib.suppress(psutil.NoSuchProcess):
                if "winding_dashboard" in child.cmdline():
                    return child
        return None

    def memory_mb(self) -> float:
        """Return what the command and its page hold [MB]."""
        held = filter(None, (psutil.Process(self.process.pid), self.page()))
        return sum(item.memory_info().rss for item in held) / 1e6

    def end(self) -> tuple[int, str]:
        """Interrupt the command; return its exit code and what it printed, once it has ended."""
        self.process.send_signal(signal.SIGINT)
        output, _ = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, output


@contextlib.contextmanager
def attended_run(folder: Path, *options: str) -> Iterator[AttendedRun]:
    """Run case 4 as an operator conducts it, from the moment its page is served."""
    port = free_port()
    process = subprocess.Popen(
        [*COMMAND, "run", "--case", "4", "--dashboard", "--dashboard-port",
         str(port), "--output", str(folder), *options],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        assert any("operator's page: http://127.0.0.1:" in line for line in process.stdout)
        yield AttendedRun(url=f"http://127.0.0.1:{port}/", folder=folder, process=process)
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=PATIENCE)
