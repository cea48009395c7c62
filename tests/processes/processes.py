"""Processes of the tests: started until they are ready, waited for, ended."""

import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import psutil

COMMAND = (sys.executable, "-m", "winding_cli.cli")
PATIENCE = 240.0  # First starts compile kernels on a busy machine [s]


def free_port() -> int:
    """Return a TCP port of this machine on which nothing listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def until(
    reached: Callable[[], Any],
    patience: float = PATIENCE,
    process: "subprocess.Popen[Any] | None" = None,
) -> Any:
    """Return the first value that counts as true; fail when it does not come, or a process ends."""
    end = time.monotonic() + patience
    while not (value := reached()):
        assert process is None or process.poll() is None, "it has ended"
        assert time.monotonic() < end, f"not reached in {patience:g} s"
        time.sleep(0.02)
    return value


def page_answers(url: str) -> bool:
    try:
        urllib.request.urlopen(url, timeout=5.0).read()
    except OSError:
        return False
    return True


@dataclass(frozen=True, kw_only=True)
class Served:
    """A page, and the process that serves it."""

    url: str
    process: "subprocess.Popen[str]"


@contextmanager
def serving(*words: object, **options: Any) -> Iterator[Served]:
    """Run words and a free port until the end of the body, which begins when a page is there."""
    port = free_port()
    url = f"http://127.0.0.1:{port}/"
    words = (*words, port)
    process = subprocess.Popen([*map(str, words)], stdout=subprocess.PIPE, text=True, **options)
    try:
        until(lambda: page_answers(url))
        yield Served(url=url, process=process)
    finally:
        process.terminate()
        process.wait(30.0)


def child_of(process: "subprocess.Popen[Any]", package: str) -> psutil.Process:
    """Return the process of a package below a command that runs."""
    children = psutil.Process(process.pid).children(recursive=True)
    return next(child for child in children if package in child.cmdline())


@contextmanager
def running(
    *words: object, ready: str, end: signal.Signals = signal.SIGTERM, **options: Any
) -> Iterator["subprocess.Popen[str]"]:
    """Run Python with words until the end of the body, which begins when a line has a text.

    Both outputs of the process are one, and the body may read on. It must end well.
    """
    process = subprocess.Popen(
        [sys.executable, *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        **options,
    )
    assert process.stdout is not None
    try:
        assert any(ready in line for line in process.stdout)
        yield process
        if process.poll() is None:
            process.send_signal(end)
        output, _ = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, output
    finally:
        process.kill()
        process.wait()


def in_namespace(namespace: str) -> tuple[str, ...]:
    """Return the words with which a node joins a namespace."""
    return "--ros-args", "-r", f"__ns:=/{namespace}"


def ran(*words: object, check: bool = False, **options: Any) -> "subprocess.CompletedProcess[str]":
    """Run a command to its end; return how it ended and what it printed."""
    return subprocess.run(
        [*map(str, words)], capture_output=True, text=True, check=check, **options
    )


def python(program: str, *words: object, **options: Any) -> "subprocess.CompletedProcess[str]":
    """Run a program in a Python of its own."""
    return ran(sys.executable, "-c", program, *words, **options)
