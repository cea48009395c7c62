"""What the recorder says of itself."""

from __future__ import annotations

from dataclasses import dataclass

from winding_dashboard.state.health import Health

RECORDER = "recorder"
_UNITS = (("GB", 1e9), ("MB", 1e6), ("kB", 1e3))


@dataclass(frozen=True, kw_only=True)
class Recording:
    """The bag that is being recorded.

    Attributes:
        bag: Name of its folder; empty when nothing is recorded.
        messages: So many are in it.
        size: Bytes of it on the disk.
        lost: Messages that never arrived.
        said: What the recorder says; empty when it is not heard.
    """

    bag: str = ""
    messages: int = 0
    size: int = 0
    lost: int = 0
    said: str = ""

    @property
    def on(self) -> bool:
        """Whether something is being recorded."""
        return bool(self.bag)


def recording_of(health: Health) -> Recording:
    """Return what was last heard of the recorder; nothing recorded when it says nonsense."""
    values = health.values(RECORDER)
    try:
        return Recording(
            bag=values.get("bag", ""),
            messages=int(values.get("messages", 0)),
            size=int(values.get("bytes", 0)),
            lost=int(values.get("lost", 0)),
            said=health.message(RECORDER),
        )
    except ValueError:
        return Recording()


def recording_sentence(recording: Recording) -> str:
    """Return what an operator reads of a recording."""
    if not recording.on:
        ended = recording.said.startswith("the recording has ended")
        return recording.said if ended else "nothing is being recorded"
    lost = f", {recording.lost} never arrived" if recording.lost else ""
    messages = f"{recording.messages:,}".replace(",", " ")
    return f"into {recording.bag}: {messages} messages, {size_text(recording.size)}{lost}"


def size_text(size: int) -> str:
    """Return a number of bytes with a unit."""
    for unit, factor in _UNITS:
        if size >= factor:
            return f"{size / factor:.1f} {unit}"
    return f"{size} bytes"
