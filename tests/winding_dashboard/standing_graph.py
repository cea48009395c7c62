"""Bring a real graph of processes up and let it stand until it is asked to end.

python standing_graph.py NAMESPACE DIRECTORY prints READY when all nodes are active.
It ends when its standard input is closed.
"""

import asyncio
import sys
from pathlib import Path

from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.graph import GRAPH, pace_topics
from winding_supervisor.processes.orchestrator import GraphConfig, Orchestrator


async def stand(namespace: str, directory: Path) -> None:
    client = AsyncClient(namespace)
    client.start()
    parameters: dict[str, dict[str, object]] = {
        spec.name: {"case": 4, "duration": 60.0} for spec in GRAPH
    }
    paced = [topic.name for topic in pace_topics() if topic is not topics.RECORDER_PROGRESS]
    parameters[topics.RIG]["pace_topics"] = ",".join(paced)
    graph = Orchestrator(
        GraphConfig(namespace=namespace, log_directory=directory, parameters=parameters), client
    )
    try:
        await graph.start()
        await graph.bring_up()
        print("READY", flush=True)
        await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
    finally:
        await graph.stop()
        client.close()


if __name__ == "__main__":
    asyncio.run(stand(sys.argv[1], Path(sys.argv[2])))
