"""Work that goes on beside other work and ends with it."""

import asyncio
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from typing import Any


@asynccontextmanager
async def beside(*work: Coroutine[Any, Any, Any]) -> AsyncIterator[tuple[asyncio.Task[Any], ...]]:
    """Do work in tasks of its own while the body runs; what is left of it is cancelled then."""
    tasks = tuple(asyncio.create_task(item) for item in work)
    try:
        yield tasks
    finally:
        for task in tasks:
            task.cancel()
