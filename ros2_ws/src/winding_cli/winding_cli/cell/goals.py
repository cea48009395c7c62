"""Goals of a cell controller, one after the other: each is a run of its own process. No ROS."""

import json
import os
import signal
import subprocess
import threading
import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any

_KEPT_LINES = 20  # Lines of a run's output that are kept: the last names the cause of its end


class GoalState(IntEnum):
    """As action_msgs/GoalStatus numbers them."""

    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6

    @property
    def ended(self) -> bool:
        """Whether nothing more comes of the goal."""
        return self >= GoalState.SUCCEEDED


class GoalError(ValueError):
    """A goal is refused."""


@dataclass(kw_only=True)
class Goal:
    """One run that was asked for."""

    id: uuid.UUID  # Sixteen bytes, as action_msgs/GoalInfo has them
    accepted_ns: int  # When it was accepted, since the epoch [ns]
    folder: Path  # What the run leaves
    state: GoalState = GoalState.EXECUTING  # How far it has come
    lines: list[str] = field(default_factory=list)  # The last lines of its output

    @property
    def news(self) -> str:
        """The last line that the run has printed."""
        return self.lines[-1] if self.lines else ""

    def result(self) -> dict[str, Any] | None:
        """Return the run's folder and the numbers that it has left; None while there are none."""
        file = self.folder / "run.json"
        if not self.state.ended or not file.is_file():
            return None
        return {"folder": str(self.folder), **json.loads(file.read_text(encoding="utf-8"))}


class Goals:
    """Takes a goal at a time; a further one is refused until it has ended.

    Args:
        command: The run's command, to which the goal's options are added.
        folder: Gets a folder for every goal.
        clock: Time since the epoch [ns].
        record: Whether every run is recorded, into `bag` in its folder.
    """

    def __init__(
        self,
        command: Sequence[str],
        folder: Path,
        clock: Callable[[], int],
        *,
        record: bool = False,
    ) -> None:
        self.goal: Goal | None = None  # The newest; None before the first
        self._command = list(command)
        self._folder = folder
        self._clock = clock
        self._record = record
        self._process: subprocess.Popen[str] | None = None
        self._reader: threading.Thread | None = None

    def send(self, options: Mapping[str, object]) -> Goal:
        """Begin a run with options of `winding run`, by name with underscores.

        Raises:
            GoalError: Another goal is executing, or no process can be started.
        """
        if self.goal is not None and not self.goal.state.ended:
            raise GoalError(f"goal {self.goal.id} is executing; cancel it first")
        identity = uuid.uuid4()
        goal = Goal(id=identity, accepted_ns=self._clock(), folder=self._folder / str(identity))
        words = [*typed(options), f"--output={goal.folder}"]
        if self._record:
            words.append(f"--bag={goal.folder / 'bag'}")
        try:
            self._process = subprocess.Popen(
                [*self._command, *words],
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                # Both streams in their order, and news when there is news.
                env={**os.environ, "PYTHONUNBUFFERED": "1"},
            )
        except OSError as error:
            raise GoalError(f"no process can be started: {error.strerror}") from error
        self.goal = goal
        self._reader = threading.Thread(target=self._read, args=(goal, self._process))
        self._reader.start()
        return goal

    def cancel(self) -> bool:
        """Interrupt the goal that is executing; return whether there was one."""
        if self.goal is None or self.goal.state is not GoalState.EXECUTING:
            return False
        assert self._process is not None
        self.goal.state = GoalState.CANCELING
        self._process.send_signal(signal.SIGINT)
        return True

    def close(self) -> None:
        """Cancel what is executing, and wait for its end."""
        self.cancel()
        self.wait()

    def wait(self) -> None:
        """Wait for the end of the goal that is executing, if there is one."""
        if self._reader is not None:
            self._reader.join()

    def _read(self, goal: Goal, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            if line.strip():
                goal.lines = [*goal.lines[-_KEPT_LINES:], line.strip()]
        code = process.wait()
        if goal.state is GoalState.CANCELING:
            goal.state = GoalState.CANCELED
        else:
            goal.state = GoalState.SUCCEEDED if code == 0 else GoalState.ABORTED


def typed(options: Mapping[str, object]) -> list[str]:
    """Return options by name as a command line."""
    words: list[str] = []
    for name, value in options.items():
        option = name.replace("_", "-")
        if isinstance(value, bool):
            words.append(f"--{option}" if value else f"--no-{option}")
        elif isinstance(value, Iterable) and not isinstance(value, str):
            words.append(f"--{option}={','.join(map(str, value))}")
        else:
            # In one word: no value can be taken for an option.
            words.append(f"--{option}={value}")
    return words
