"""What recordings of the tests hold."""

from pathlib import Path

from winding_recorder.bags.reading import messages_of, opened


def recorded(bag: Path, topic: str) -> list[bytes]:
    """Return the CDR bytes of a topic's messages in a bag, by its last names, in order."""
    with opened(bag) as reader:
        links = [link for link in reader.connections if link.topic.endswith(topic)]
        return [data for _, _, data in messages_of(reader, links)]
