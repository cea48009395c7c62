"""A time limit that says what was late."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager


@asynccontextmanager
async def deadline(timeout: float, sentence: str) -> AsyncIterator[None]:
    """Raise TimeoutError with a sentence when the body takes longer than timeout [s]."""
    try:
        async with asyncio.timeout(timeout):
            yield
    except TimeoutError:
        raise TimeoutError(sentence) from None
