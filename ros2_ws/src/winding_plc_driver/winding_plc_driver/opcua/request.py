"""One request and its answer, with a time limit of its own, and what can go wrong with it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from asyncua import Client, ua
from asyncua.ua.ua_binary import struct_from_binary


class LinkError(Exception):
    """The PLC cannot be reached, or no longer."""


class RefusedError(Exception):
    """The PLC is there and does not do what it is asked."""


@contextmanager
def in_one_sentence(what: str, timeout: float) -> Iterator[None]:
    """Turn what a request may raise into one sentence.

    Args:
        what: The request, as the sentence calls it.
        timeout: After which the library gives a request up [s].

    Raises:
        LinkError: The connection is lost, or there was no answer in time.
        RefusedError: The server answered with an error.
    """
    try:
        yield
    except TimeoutError:
        raise LinkError(f"{what} was not answered within {timeout:g} s") from None
    except OSError as error:
        raise LinkError(f"{what} failed: {_sentence(error)}") from None
    except (ua.UaError, ValueError) as error:
        raise RefusedError(f"{what} was refused: {_sentence(error)}") from None


def _sentence(error: Exception) -> str:
    if isinstance(error, ua.UaStatusCodeError):
        status = ua.StatusCode(error.code)
        return f"{status.doc.rstrip('.')} ({status.name})"
    return " ".join(str(error).split()) or type(error).__name__


async def ask(client: Client, request: Any, answer_type: type, timeout: float) -> Any:
    """Return the server's answer.

    The library waits by itself: asyncio.wait_for of Python 3.11 loses a cancellation that comes
    with the answer, and the driver would not end.

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
