"""Starts and restarts: work is waited for, idleness is not, and what is down hinders no other."""

import asyncio
import os
import signal
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.client.lifecycle import CONFIGURE, LifecycleDriver, deadline
from winding_ros.environment import set_process_environment
from winding_ros.graph import GRAPH, pace_topics
from winding_supervisor.processes.node_process import NodeProcess, node_process
from winding_supervisor.processes.orchestrator import GraphConfig, Orchestrator

NAMESPACE = "starting"
PATIENCE = 120.0
IDLE = 2.0  # What a node may be idle for [s]: far less than its kernels take to compile


@pytest.fixture
def client(tmp_path: Path) -> Iterator[AsyncClient]:
    set_process_environment(int(os.environ["ROS_DOMAIN_ID"]), tmp_path / "ros")
    made = AsyncClient(NAMESPACE)
    made.start()
    yield made
    made.close()


async def until(reached: Callable[[], Any]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not reached():
            await asyncio.sleep(0.02)


def test_whoever_works_is_waited_for_and_whoever_does_not_is_given_up() -> None:
    done: list[int] = []

    def work() -> int:
        # Ten times what an idle body may take, then nothing more.
        if len(done) < 200:
            done.append(0)
        return len(done)

    async def wait(sentence: str) -> None:
        async with deadline(0.4, sentence, work):
            await asyncio.get_running_loop().create_future()

    with pytest.raises(TimeoutError, match="idle at last"):
        asyncio.run(wait("idle at last"))
    assert len(done) == 200


Work = Callable[[LifecycleDriver], Awaitable[None]]


async def started(node: NodeProcess, work: Work, client: AsyncClient) -> None:
    """Do something with a node that has started; its process ends with it."""
    driver = LifecycleDriver(client, NAMESPACE, lambda _: node.refusal(5.0), lambda _: node.work())
    await node.start()
    try:
        await driver.first_state(node.spec.name)
        await work(driver)
    finally:
        await node.kill()


@pytest.mark.slow
@pytest.mark.asyncio
async def test_a_node_whose_parameters_are_gone_names_their_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "ros"))
    spec = next(spec for spec in GRAPH if spec.name == topics.CORRECTION)
    node = node_process(spec, NAMESPACE, tmp_path, {})
    file = tmp_path / f"{topics.CORRECTION}.yaml"
    file.unlink()
    await node.start()
    assert await node.ended() != 0
    await node.kill()
    assert node.complaint() == f"{file} is gone"


@pytest.mark.processes
@pytest.mark.campaign
def test_compiling_is_no_deadline_and_is_seen(
    client: AsyncClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cold"))
    spec = next(spec for spec in GRAPH if spec.name == topics.FEM)
    node = node_process(spec, NAMESPACE, tmp_path, {"case": 7, "duration": 2.0})
    shares: dict[str, None] = {}

    async def configure(driver: LifecycleDriver) -> None:
        waiting = asyncio.create_task(driver.change(topics.FEM, CONFIGURE, IDLE))
        while not waiting.done():
            status = client.status(topics.FEM)
            shares.update(dict.fromkeys([status.values.get("compiling", "")] if status else []))
            await asyncio.sleep(0.02)
        await waiting

    asyncio.run(started(node, configure, client))
    seen = [share.split(" of ") for share in shares if share]
    numbers = [int(number) for number, _ in seen]
    assert len(numbers) > 2
    assert numbers == sorted(numbers)
    assert all(int(number) <= int(count) for number, count in seen)
    assert "kernels (first start only): cable_fem_node." in (tmp_path / "cable_fem.log").read_text()


@pytest.mark.processes
def test_a_held_process_is_given_up(client: AsyncClient, tmp_path: Path) -> None:
    spec = next(spec for spec in GRAPH if spec.name == topics.CORRECTION)
    node = node_process(spec, NAMESPACE, tmp_path, {"case": 7})

    async def configure(driver: LifecycleDriver) -> None:
        os.kill(node.pid, signal.SIGSTOP)
        await driver.change(topics.CORRECTION, CONFIGURE, IDLE)

    with pytest.raises(TimeoutError, match="correction does not configure: no answer and no work"):
        asyncio.run(started(node, configure, client))


@pytest.mark.processes
@pytest.mark.campaign
def test_nodes_that_die_in_a_restart_wait_for_theirs(client: AsyncClient, tmp_path: Path) -> None:
    paced = [topic.name for topic in pace_topics() if topic is not topics.RECORDER_PROGRESS]
    parameters: dict[str, dict[str, object]] = {
        spec.name: {"case": 7, "duration": 3.0} for spec in GRAPH
    }
    parameters[topics.RIG]["pace_topics"] = ",".join(paced)
    graph = Orchestrator(
        GraphConfig(namespace=NAMESPACE, log_directory=tmp_path, parameters=parameters), client
    )
    given_up: list[str] = []

    async def restart(name: str) -> None:
        await graph.restart(name, {}, given_up.append)

    async def work() -> None:
        await graph.start()
        try:
            await graph.bring_up()
            assert graph.down() == frozenset()
            # Both at once.
            for name in (topics.TRACKER, topics.CORRECTION):
                os.kill(graph.process(name).pid, signal.SIGKILL)
            await until(lambda: graph.down() == {topics.TRACKER, topics.CORRECTION})
            await restart(topics.CORRECTION)
            await graph.rematch([topics.CORRECTION])
            assert graph.down() == {topics.TRACKER}
            # One during the other's restart, whose successor is killed once, too.
            before = graph.process(topics.TRACKER)
            restarting = asyncio.create_task(restart(topics.TRACKER))
            await until(lambda: graph.process(topics.TRACKER) is not before)
            await until(lambda: graph.process(topics.TRACKER).started)
            os.kill(graph.process(topics.TRACKER).pid, signal.SIGKILL)
            os.kill(graph.process(topics.CORRECTION).pid, signal.SIGKILL)
            await restarting
            await graph.rematch([topics.TRACKER])
            assert graph.down() == {topics.CORRECTION}
            await restart(topics.CORRECTION)
            await graph.rematch([topics.CORRECTION])
            assert graph.down() == frozenset()
        finally:
            await graph.kill()

    asyncio.run(work())
    assert [sentence.partition(":")[0] for sentence in given_up] == ["was not active again"]
