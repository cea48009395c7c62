"""One request and its answer, with a time limit of its own."""

from __future__ import annotations

from typing import Any

from asyncua import Client
from asyncua.ua.ua_binary import struct_from_binary


async def ask(client: Client, request: Any, answer_type: type, timeout: float) -> Any:
    """Return the server's answer.

    The library waits by itself: asyncio.wait_for of Python 3.11 loses a cancellation that comes
    with the answer, and the driver would not end.

    Args:
        client: Connected.
        request: Of a type of the standard.
        answer_type: Type of its answer.
        timeout: After which it is given up [s].

    Raises:
        UaError: The server refuses it.
        ConnectionError: The connection is lost.
        TimeoutError: There was no answer in time.
    """
    protocol = client.uaclient.protocol
    if protocol is None:
        raise ConnectionError("the connection is lost")
    data = await protocol.send_request(request, timeout)
    answer = struct_from_binary(answer_type, data)
    answer.ResponseHeader.ServiceResult.check()
    return answer
