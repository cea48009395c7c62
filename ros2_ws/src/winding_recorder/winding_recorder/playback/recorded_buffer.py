"""A recording as the buffer of its run, for what is made of a run afterwards."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from winding_core.machine.axes import MachineAxes
from winding_core.parameters import ParameterError
from winding_recorder.bags.contents import configuration_of, recorded_parameters
from winding_recorder.bags.description import COMPLETE, ORIGIN, PARAMETERS, YES, BagError
from winding_recorder.bags.reading import opened, read_notes, stamped_messages
from winding_recorder.live.run_buffer import PICTURES, BufferedMessage, RunBuffer
from winding_ros import topics
from winding_ros.topic import Topic

# /diagnostics belongs to no namespace.
_RECORDED = {topic.name.lstrip("/"): topic for topic in topics.TOPICS if topic not in PICTURES}


@dataclass(frozen=True, kw_only=True)
class RecordedRun:
    """A run as its recording has it."""

    buffer: RunBuffer  # Its messages but the pictures
    parameters: Mapping[str, Mapping[str, Any]]  # Of every node that it states, by name
    ended: str  # Why the recording ended before the run; empty for a whole one
    origin: str = ""  # Which run it was, as JSON text; empty where that was not recorded


def recorded_run(path: Path) -> RecordedRun:
    """Return a recorded run.

    Raises:
        BagError: It cannot be read, states no parameters of the solver, or holds no motion.
    """
    notes = read_notes(path)
    nodes = [name.removeprefix(PARAMETERS) for name in notes if name.startswith(PARAMETERS)]
    parameters = {node: recorded_parameters(path, node) for node in nodes}
    if topics.FEM not in parameters:
        raise BagError(f"{path} does not say what was wound")
    buffer = _filled(path)
    try:
        buffer.axes = configuration_of(MachineAxes, parameters[topics.FEM], topics.FEM)
    except ParameterError as error:
        raise BagError(f"{path}: {error}") from error
    first = next(buffer.axis_readings(), None)
    if first is None:
        raise BagError(f"{path} holds no {topics.JOINT_STATES.name}")
    if topics.RIG not in parameters:
        # A real machine's clock began before its run.
        buffer.origin = first[0]
    complete = notes.get(COMPLETE, YES)
    return RecordedRun(
        buffer=buffer,
        parameters=parameters,
        ended="" if complete == YES else complete,
        origin=notes.get(ORIGIN, ""),
    )


def _filled(path: Path) -> RunBuffer:
    with opened(path) as reader:
        links = {link.id: topic for link in reader.connections if (topic := _topic(link.topic))}
        buffer = RunBuffer(dict.fromkeys(links.values()))
        wanted = [link for link in reader.connections if link.id in links]
        for link, own, arrived, data in stamped_messages(reader, wanted):
            buffer.add(links[link.id], BufferedMessage(own, arrived, arrived, data))
    return buffer


def _topic(full_name: str) -> Topic | None:
    """Return the topic that a full name such as /winding/rig/tension means."""
    words = full_name.strip("/").split("/")
    return next(
        (topic for n in range(len(words)) if (topic := _RECORDED.get("/".join(words[n:])))), None
    )
