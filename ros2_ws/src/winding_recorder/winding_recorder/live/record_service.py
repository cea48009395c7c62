"""Service recorder/record on a node that nobody spins: requests are taken when asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool

from winding_ros.services import RECORD


@dataclass(frozen=True, kw_only=True)
class RecordRequest:
    """Somebody wants the recording on or off.

    Attributes:
        on: Which of the two.
        answer: Takes whether it was done and a sentence; to be called once, from any thread.
    """

    on: bool
    answer: Callable[[bool, str], None]


class RecordService:
    """Takes requests between messages, so that they are in order with what is recorded.

    Args:
        node: It must not be spun.
    """

    def __init__(self, node: Node) -> None:
        self._service = node.create_service(RECORD.type, RECORD.name, _called)

    def take(self) -> Iterator[RecordRequest]:
        """Yield the requests that wait."""
        while True:
            with self._service.handle:
                request, header = self._service.handle.service_take_request(SetBool.Request)
            if header is None:
                return
            yield RecordRequest(on=bool(request.data), answer=self._answering(header))

    def _answering(self, header: Any) -> Callable[[bool, str], None]:
        def answer(success: bool, message: str) -> None:
            self._service.send_response(SetBool.Response(success=success, message=message), header)

        return answer


def _called(_request: Any, _response: Any) -> Any:
    raise RuntimeError("the node of the recorder's service is spun")
