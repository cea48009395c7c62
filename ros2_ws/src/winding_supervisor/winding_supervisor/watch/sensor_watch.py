"""Do the machine's topics keep step with each other? Pure: stamps in, findings out."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from statistics import median

# Simulated time that a topic may lie behind the others [s]; readers may lag by 0.25 s as a whole,
# topics among each other by less.
_LAG = 0.12
_LEAD = 0.5  # Simulated time that a topic may lie ahead of the others [s]
# Wall time for which it has to do so [s]; one that lies behind has to stand still as well, for a
# busy machine or disk makes topics late without silencing them.
_PATIENCE = 2.0
# Wall time without any progress of an awaited answer [s], while who gives it wants no processor.
_STANDSTILL = 5.0


@dataclass(kw_only=True)
class SensorWatch:
    """Compares the newest stamps of one machine's topics."""

    _since: dict[str, tuple[float, float]] = field(default_factory=dict)
    # Of each answer its newest stamp, for how long nothing newer was waited for, and until when [s]
    _progress: dict[str, tuple[float, float, float]] = field(default_factory=dict)

    def look(
        self,
        now: float,
        sensors: Mapping[str, float],
        answers: Mapping[str, float],
        at_work: Callable[[str], bool] = lambda _topic: False,
    ) -> tuple[str, str] | None:
        """Return which topic is wrong at wall time `now` [s], and how, to follow its name; or None.

        Args:
            now: Wall time [s].
            sensors: Newest stamp [s] of each topic of the machine.
            answers: Newest stamp [s] of each topic that follows the machine.
            at_work: Returns whether who gives an answer wants the processor.
        """
        middle = median(sensors.values())
        for topic, stamp in sensors.items():
            late = stamp < middle - _LAG
            early = stamp > middle + _LEAD
            if not late and not early:
                self._since.pop(topic, None)
                continue
            seen, since = self._since.get(topic, (stamp, now))
            if late and stamp != seen:
                since = now
            self._since[topic] = (stamp, since)
            if now - since >= _PATIENCE:
                if early:
                    return topic, f"is at {stamp:.3f} s while the machine is at {middle:.3f} s"
                return topic, f"is silent since {stamp:.3f} s of simulated time"
        for topic, stamp in answers.items():
            last, waited, before = self._progress.get(topic, (stamp, 0.0, now))
            if stamp != last or stamp >= middle - _LAG:
                waited = 0.0
            elif not at_work(topic):
                waited += now - before
            self._progress[topic] = (stamp, waited, now)
            if waited >= _STANDSTILL:
                return topic, f"has brought nothing new since {stamp:.3f} s of simulated time"
        return None

    def forget(self) -> None:
        """Begin anew: the machine stood meanwhile."""
        self._since.clear()
        self._progress.clear()
