"""What a node tells in `/diagnostics` of its topics: matched, heard, waiting, refused."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from winding_core.status import Level, Status
from winding_ros.message_guard import MessageGuard

_MATCHED = "matched "


def topic_status(
    node: str,
    subscribers: Mapping[str, int],
    intakes: Mapping[str, MessageGuard],
    contested: Sequence[str],
) -> Status:
    """Return the status of a node's topics.

    Args:
        node: Its name.
        subscribers: How many subscriptions each of its publishers has, by topic.
        intakes: What it made of the messages of each topic that it hears.
        contested: One sentence for each topic that others publish too.
    """
    values = {f"{_MATCHED}{name}": str(count) for name, count in subscribers.items()}
    refusing = [intake for intake in intakes.values() if intake.refused]
    values |= {f"heard {name}": str(item.accepted) for name, item in intakes.items()}
    values |= {f"queue {name}": str(item.queue) for name, item in intakes.items()}
    values |= {f"refused {item.topic}": str(item.refused) for item in refusing}
    errors = [*contested, *(_refusal(intake) for intake in refusing if intake.persistent)]
    warnings = [_refusal(intake) for intake in refusing if not intake.persistent]
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
    """Return what of these statuses is told at once when it changes."""
    return [
        (status.name, status.level, status.message, subscribers_of(status.values))
        for status in statuses
    ]


def _refusal(intake: MessageGuard) -> str:
    return f"refused a message on {intake.topic}: {intake.reason}"
