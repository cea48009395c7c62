"""What is left of a session that cannot go on: its page, until the operator ends it."""

from __future__ import annotations

import asyncio

from winding_core.status import COMPONENT, Level, RunPhase
from winding_ros.client.async_client import AsyncClient
from winding_supervisor.dashboard_process import DashboardProcess

_PERIOD = 1.0


async def outlive(
    failure: str, page: DashboardProcess, client: AsyncClient, ended: asyncio.Event
) -> None:
    """Keep the page served and say in the diagnostics what has failed.

    Args:
        failure: Why the session cannot go on.
        page: That outlives it.
        client: The orchestrator's node.
        ended: Is set when the operator ends the session.

    Raises:
        GraphError: The page failed, too.
    """
    saying = asyncio.create_task(_keep_saying(failure, client))
    try:
        await page.keep_until(ended)
    finally:
        saying.cancel()


async def _keep_saying(failure: str, client: AsyncClient) -> None:
    sentence = f"the session cannot go on: {failure}"
    while True:
        client.tell(0.0, Level.ERROR, COMPONENT, sentence, {"phase": RunPhase.FAILED.value})
        await asyncio.sleep(_PERIOD)
