"""Processors, memory, open files and socket buffers."""

from __future__ import annotations

from winding_cli.doctor.finding import Finding, fail, ok, warn

# Measured: the graph of a run takes 1.6 of two processors at speed 0, and 1.5 GB.
_PROCESSORS = 2
_MEMORY = 2.0e9
_GIGABYTE = 1.0e9
# The orchestrator holds 43 files during a run, a node 26.
_FILES_HELD, _FILES_NEEDED, _FILES_EASY = 43, 64, 256
# Kernel's default. Nothing is lost with it; with the 4 MB that the graph asks for a reader may be
# late for longer before something has to be sent again.
_RECEIVE_BUFFER = 212_992


def judge_processors(count: int, load: float) -> Finding:
    """Return whether there is time for the graph.

    Args:
        count: Processors that this process may use.
        load: Count of processes that wanted one, on average over the last minute.
    """
    found = f"{count} with {load:.1f} processes wanting them"
    if count < _PROCESSORS:
        return warn("processors", found, "runs are slower than real time; give the machine two")
    if load > count:
        return warn("processors", found, "runs and their supervision are late until others end")
    return ok("processors", found)


def judge_memory(available: float) -> Finding:
    """Return whether available memory [bytes] holds the graph and the buffer of a run."""
    found = f"{available / _GIGABYTE:.1f} GB available"
    if available < _MEMORY:
        return warn("memory", found, f"the graph takes {_MEMORY / _GIGABYTE:.0f} GB; end others")
    return ok("memory", found)


def judge_open_files(limit: int) -> Finding:
    """Return whether a process may open as many files as the graph's busiest does."""
    found = f"{limit} for each process; the orchestrator of a run holds {_FILES_HELD}"
    advice = "ulimit -n 1024, or LimitNOFILE=1024 in the unit"
    if limit < _FILES_NEEDED:
        return fail("open files", found, advice)
    if limit < _FILES_EASY:
        return warn("open files", found, advice)
    return ok("open files", found)


def judge_receive_buffer(limit: int | None) -> Finding:
    """Return whether sockets may be given a receive buffer [bytes]; None when nobody can tell."""
    check = "net.core.rmem_max"
    if limit is None:
        return ok(check, "cannot tell")
    found = f"{limit} bytes"
    if limit < _RECEIVE_BUFFER:
        return warn(check, found, f"sysctl -w {check}={_RECEIVE_BUFFER}")
    return ok(check, found)
