"""What can go wrong between driver and PLC, each in one sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from asyncua import ua


class LinkError(Exception):
    """The PLC cannot be reached, or no longer."""


class RefusedError(Exception):
    """The PLC is there and does not do what it is asked."""


@contextmanager
def told(what: str, timeout: float) -> Iterator[None]:
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
