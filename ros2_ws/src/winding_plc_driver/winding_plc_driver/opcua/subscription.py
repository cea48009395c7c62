"""One subscription to all watched variables: every notification once and in order."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Sequence
from datetime import UTC, datetime, timedelta

from asyncua import Client, ua

from winding_plc_driver.machine.mapping import Server
from winding_plc_driver.machine.reading import SequenceNumbers, ServerValue
from winding_plc_driver.opcua.nodes import Nodes
from winding_plc_driver.opcua.request import LinkError, RefusedError, ask, in_one_sentence

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
# Part 4 of OPC UA, status codes: the bits of a value that comes from a queue that was full.
_INFO, _OVERFLOW = 0xC80, 0x480
_NO_FILTER = (
    ua.StatusCodes.BadMonitoredItemFilterUnsupported,
    ua.StatusCodes.BadMonitoredItemFilterInvalid,
    ua.StatusCodes.BadFilterNotAllowed,
)


class Subscription:
    """The subscription of a session.

    Args:
        client: Connected when it is used.
        server: Intervals, queue and waits.
        nodes: What is watched.
        timeout: After which the client gives a request up [s].

    Attributes:
        numbers: Order of the notifications.
    """

    def __init__(self, client: Client, server: Server, nodes: Nodes, timeout: float) -> None:
        self.numbers = SequenceNumbers()
        self._timeout = timeout
        self._client = client
        self._server = server
        self._nodes = nodes
        self._id: int | None = None
        self._acknowledgements: list[ua.SubscriptionAcknowledgement] = []

    @property
    def begun(self) -> bool:
        """Whether the session has it, as far as the driver knows."""
        return self._id is not None

    def forget(self) -> None:
        """Note that the server has it no longer."""
        self._id = None

    async def begin(self) -> None:
        """Subscribe to every watched variable.

        Raises:
            UaError: The server refuses it.
            ConnectionError: The connection is lost.
        """
        server, interval = self._server, self._server.publishing_interval_s
        # Several signs of life fit into the silence after which the link counts as lost.
        keep_alive = max(1, int(server.link_timeout_s / 4.0 / interval))
        lifetime = max(3 * keep_alive, round(server.hold_s / interval))
        request = ua.CreateSubscriptionRequest()
        request.Parameters.RequestedPublishingInterval = 1000.0 * interval
        request.Parameters.RequestedMaxKeepAliveCount = keep_alive
        request.Parameters.RequestedLifetimeCount = lifetime
        request.Parameters.PublishingEnabled = True
        # The library's own call would also begin to publish, and in an order of its own.
        answer = await ask(self._client, request, ua.CreateSubscriptionResponse, self._timeout)
        self._id = answer.Parameters.SubscriptionId
        self.numbers.restart()
        self._acknowledgements = []
        results = await self._monitor(range(len(self._nodes.watched)), filtered=True)
        refused = [k for k, item in enumerate(results) if item.StatusCode.value in _NO_FILTER]
        for k, result in zip(refused, await self._monitor(refused, filtered=False), strict=True):
            results[k] = result
        for result in results:
            result.StatusCode.check()

    async def notifications(self) -> AsyncGenerator[list[ServerValue], None]:
        """Yield the values of each notification in order; an empty list for a sign of life.

        Raises:
            LinkError: Nothing came for the link timeout, or the connection is lost.
            RefusedError: The server has ended the subscription.
        """
        limit = self._server.link_timeout_s
        while True:
            try:
                with in_one_sentence("the subscription", limit):
                    request = ua.PublishRequest()
                    request.Parameters.SubscriptionAcknowledgements = self._acknowledgements
                    answer = await ask(self._client, request, ua.PublishResponse, limit)
            except RefusedError:
                self.forget()
                raise
            self._acknowledgements = []
            result = answer.Parameters
            for number in self.numbers.missing(result.NotificationMessage.SequenceNumber):
                yield await self._fetch(number, result.AvailableSequenceNumbers)
            data = result.NotificationMessage.NotificationData
            yield self._take(result.NotificationMessage) if data else []

    async def _fetch(self, number: int, available: list[int]) -> list[ServerValue]:
        """Return the values of a notification that was missed, none when it cannot be had."""
        if number in available:
            with in_one_sentence("a repetition", self._timeout):
                message = await self._client.uaclient.session.republish(self._id or 0, number)
            if message.SequenceNumber == number:
                self.numbers.fetched += 1
                return self._take(message)
        self.numbers.skip(number)
        return []

    def _take(self, message: ua.NotificationMessage) -> list[ServerValue]:
        """Return the values of a notification, none when it came before."""
        number = message.SequenceNumber
        self._acknowledgements.append(ua.SubscriptionAcknowledgement(self._id, number))
        if not self.numbers.take(number):
            return []
        for data in message.NotificationData:
            if isinstance(data, ua.StatusChangeNotification):
                self.forget()
                raise LinkError(f"the server ends the subscription: {data.Status.name}")
        return [
            _server_value(self._nodes.watched[item.ClientHandle], item.Value)
            for data in message.NotificationData
            if isinstance(data, ua.DataChangeNotification)
            for item in data.MonitoredItems
        ]

    async def _monitor(
        self, items: Sequence[int], *, filtered: bool
    ) -> list[ua.MonitoredItemCreateResult]:
        """Return the server's results for the monitoring of watched variables, by their index."""
        requests = []
        for k in items:
            parameters = ua.MonitoringParameters(
                ClientHandle=k,
                SamplingInterval=1000.0 * self._server.sampling_interval_s,
                QueueSize=self._server.queue_size,
                DiscardOldest=True,
            )
            if filtered:
                # A value that was sampled anew is reported even where it is the same.
                parameters.Filter = ua.DataChangeFilter(
                    Trigger=ua.DataChangeTrigger.StatusValueTimestamp
                )
            item = ua.ReadValueId(
                NodeId=self._nodes[self._nodes.watched[k]], AttributeId=ua.AttributeIds.Value
            )
            requests.append(
                ua.MonitoredItemCreateRequest(
                    ItemToMonitor=item,
                    MonitoringMode=ua.MonitoringMode.Reporting,
                    RequestedParameters=parameters,
                )
            )
        if not requests:
            return []
        results: list[ua.MonitoredItemCreateResult]
        results = await self._client.uaclient.session.create_monitored_items(
            ua.CreateMonitoredItemsParameters(
                SubscriptionId=self._id,
                TimestampsToReturn=ua.TimestampsToReturn.Both,
                ItemsToCreate=requests,
            )
        )
        return results


def _server_value(title: str, data: ua.DataValue) -> ServerValue:
    stamp = data.SourceTimestamp or data.ServerTimestamp
    status = data.StatusCode or ua.StatusCode()
    return ServerValue(
        title=title,
        value=data.Value.Value if data.Value is not None else None,
        stamp_ns=(stamp - _EPOCH) // timedelta(microseconds=1) * 1000 if stamp else None,
        bad=status.name if status.is_bad() else "",
        overflow=status.value & _INFO == _OVERFLOW,
    )
