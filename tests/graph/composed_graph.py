"""Composed runs: nodes in the process of the tests, heard by a recorder."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from winding_recorder.live.recorder import Recorder
from winding_ros import topics
from winding_ros.graph import GRAPH, expected_subscribers, pace_topics
from winding_ros.topic import Topic


@contextmanager
def composed_run(
    compose: Callable[..., Any],
    ros: Any,
    condition: Mapping[str, object],
    recorded: Iterable[Topic],
    **own: Mapping[str, object],
) -> Iterator[tuple[Any, Recorder]]:
    """Yield the node of the recorder and the recorder of a graph whose nodes are all matched.

    Args:
        compose: The fixture; frames are handed over in the process.
        ros: The fixture.
        condition: Of all nodes.
        recorded: What is recorded.
        own: Further parameters by node.
    """
    listener, names = ros.plain("recorder_host"), [topic.name for topic in recorded]
    recorder = Recorder(listener, None, recorded=[t for t in topics.TOPICS if t.name in names])
    pace = ",".join(topic.name for topic in pace_topics())
    parameters = {spec.name: {**condition, **own.get(spec.name, {})} for spec in GRAPH}
    parameters[topics.RIG] = {"speed": 0.0, "pace_topics": pace, **parameters[topics.RIG]}
    graph = None
    try:
        graph = compose(ros, parameters, direct_frames=True)
        expected = expected_subscribers(frozenset(names))
        ros.spin_until(
            lambda: all(
                graph.nodes[node].matched(topic) >= count
                for node, counts in expected.items()
                for topic, count in counts.items()
                if topic != topics.IMAGE.name
            )
        )
        yield listener, recorder
    finally:
        if graph is not None:
            graph.close()
        recorder.close()
