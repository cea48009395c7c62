"""What a node tells in `/diagnostics` of its topics: matched, heard, waiting, refused."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from winding_core.status import Level, Status
from winding_ros.message_guard import MessageGuard

_MATCHED = "matched "


def topic_status(
    node: str,
    subscribers: Mapping[str, int],
    guards: Mapping[str, MessageGuard],
    contested: Sequence[str],
) -> Status:
    """Return the status of a node's topics.

    Args:
        node: Its name.
        subscribers: How many subscriptions each of its publishers has, by topic.
        guards: What it made of the messages of each topic that it hears.
        contested: One sentence for each topic that others publish too.
    """
    values = {f"{_MATCHED}{name}": str(count) for name, count in subscribers.items()}
    refusing = [guard for guard in guards.values() if guard.refused]
    values |= {f"heard {name}": str(item.accepted) for name, item in guards.items()}
    values |= {f"queue {name}": str(item.queue) for name, item in guards.items()}
    values |= {f"refused {item.topic}": str(item.refused) for item in refusing}
    cadences = [guard.cadence for guard in guards.values() if guard.cadence is not None]
    for cadence in cadences:
        values |= cadence.values()
    errors = [*contested, *(_refusal(guard) for guard in refusing if guard.persistent)]
    warnings = [_refusal(guard) for guard in refusing if not guard.persistent]
    warnings += [cadence.warning for cadence in cadences if cadence.warning]
    return Status(
        name=f"{node}: topics",
        level=Level.ERROR if errors else Level.WARN if warnings else Level.OK,
        message="; ".join([*errors, *warnings]),
        values=values,
    )


def subscribers_of(values: Mapping[str, str]) -> dict[str, int]:
    """Return how many subscriptions each publisher has, by topic, from the values of a status."""
    return {
        key.removeprefix(_MATCHED): int(value)
        for key, value in values.items()
        if key.startswith(_MATCHED) and value.isdigit()
    }


def news(statuses: Iterable[Status]) -> list[object]:
    """Return what of these statuses is published at once when it changes."""
    return [
        (status.name, status.level, status.message, subscribers_of(status.values))
        for status in statuses
    ]


def _refusal(guard: MessageGuard) -> str:
    return f"refused a message on {guard.topic}: {guard.reason}"
