"""One session with the PLC's server, resumed with all that it queued when the link returns."""

import asyncio
from collections.abc import AsyncGenerator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from asyncua import Client, ua
from asyncua.crypto import security_policies, uacrypto
from cryptography import x509

from winding_plc_driver.machine.mapping import Command, MachineMapping, Server
from winding_plc_driver.machine.reading import SequenceNumbers, ServerValue
from winding_plc_driver.opcua.nodes import WRITE, Nodes
from winding_plc_driver.opcua.request import LinkError, RefusedError, ask, in_one_sentence

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
# Part 4 of OPC UA, status codes: the bits of a value that comes from a queue that was full.
_INFO, _OVERFLOW = 0xC80, 0x480
_NO_FILTER = (
    ua.StatusCodes.BadMonitoredItemFilterUnsupported,
    ua.StatusCodes.BadMonitoredItemFilterInvalid,
    ua.StatusCodes.BadFilterNotAllowed,
)


@dataclass(eq=False)
class Subscription:
    """The subscription of a session."""

    client: Client  # Connected when it is used
    server: Server  # Intervals, queue and waits
    nodes: Nodes  # What is watched
    timeout: float  # After which the client gives a request up [s]

    def __post_init__(self) -> None:
        self.numbers = SequenceNumbers()  # Order of the notifications
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
        server, interval = self.server, self.server.publishing_interval_s
        # Several signs of life fit into the silence after which the link counts as lost.
        keep_alive = max(1, int(server.link_timeout_s / 4.0 / interval))
        lifetime = max(3 * keep_alive, round(server.hold_s / interval))
        request = ua.CreateSubscriptionRequest()
        request.Parameters.RequestedPublishingInterval = 1000.0 * interval
        request.Parameters.RequestedMaxKeepAliveCount = keep_alive
        request.Parameters.RequestedLifetimeCount = lifetime
        request.Parameters.PublishingEnabled = True
        # The library's own call would also begin to publish, and in an order of its own.
        answer = await ask(self.client, request, ua.CreateSubscriptionResponse, self.timeout)
        self._id = answer.Parameters.SubscriptionId
        self.numbers.restart()
        self._acknowledgements = []
        results = await self._monitor(range(len(self.nodes.watched)), filtered=True)
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
        limit = self.server.link_timeout_s
        while True:
            try:
                with in_one_sentence("the subscription", limit):
                    request = ua.PublishRequest()
                    request.Parameters.SubscriptionAcknowledgements = self._acknowledgements
                    answer = await ask(self.client, request, ua.PublishResponse, limit)
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
            with in_one_sentence("a repetition", self.timeout):
                message = await self.client.uaclient.session.republish(self._id or 0, number)
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
            _server_value(self.nodes.watched[item.ClientHandle], item.Value)
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
                SamplingInterval=1000.0 * self.server.sampling_interval_s,
                QueueSize=self.server.queue_size,
                DiscardOldest=True,
            )
            if filtered:
                # A value that was sampled anew is reported even where it is the same.
                parameters.Filter = ua.DataChangeFilter(
                    Trigger=ua.DataChangeTrigger.StatusValueTimestamp
                )
            item = ua.ReadValueId(
                NodeId=self.nodes[self.nodes.watched[k]], AttributeId=ua.AttributeIds.Value
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
        results = await self.client.uaclient.session.create_monitored_items(
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


async def secure(client: Client, server: Server) -> None:
    """Set a client's security policy; without one, nothing.

    Raises:
        UaError: A file cannot be read, or the server offers no such policy and mode.
        OSError: The server cannot be reached.
    """
    if server.security_policy == "None":
        return
    _check_files(server.certificate, server.private_key, server.server_certificate)
    certificate = await uacrypto.load_certificate(server.certificate)
    client.application_uri = _application_uri(certificate) or client.application_uri
    await client.set_security(
        getattr(security_policies, f"SecurityPolicy{server.security_policy}"),
        server.certificate,
        server.private_key,
        server_certificate=server.server_certificate or None,
        mode=ua.MessageSecurityMode[server.security_mode],
    )


async def identify(client: Client, server: Server) -> None:
    """Give a client the certificate of its user; without one, nothing.

    Raises:
        UaError: There is no such file.
        ValueError: A file holds no certificate, or no key.
    """
    if server.user_certificate:
        _check_files(server.user_certificate, server.user_private_key)
        await client.load_client_certificate(server.user_certificate)
        await client.load_private_key(Path(server.user_private_key))


def _check_files(*paths: str) -> None:
    for path in filter(None, paths):
        if not Path(path).is_file():
            raise ua.UaError(f"{path} is not a file")


def _application_uri(certificate: x509.Certificate) -> str:
    """Return the URI that a certificate is made out to, which a server compares; empty for none."""
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName)
    except x509.ExtensionNotFound:
        return ""
    uris = names.value.get_values_for_type(x509.UniformResourceIdentifier)
    return uris[0] if uris else ""


_CHANNEL_LIFETIME_S = 3600.0
_PATIENCE = 5.0  # For requests of the driver's own [s]: an answer may bring a long queue
# Part 4 of OPC UA, 5.5.2: a channel is renewed after three quarters of its lifetime.
_RENEWAL = 0.75


class Session:
    """A session, its subscription and its commands.

    Args:
        mapping: What is read, written and called.
        password: Of the user; empty for one with a certificate and for an anonymous session.

    Attributes:
        subscription: To every variable of the mapping.
        resumed: Times that the server had kept session and queue.
        renewed: Times that the channel was renewed.
    """

    def __init__(self, mapping: MachineMapping, password: str) -> None:
        self.resumed = self.renewed = 0
        self._server = server = mapping.server
        self._timeout = max(_PATIENCE, server.call_timeout_s)
        self._client = Client(server.endpoint, timeout=self._timeout)
        self._client.name = self._client.description = "winding_plc_driver"
        self._client.session_timeout = round(1000.0 * server.hold_s)
        self._client.secure_channel_timeout = round(1000.0 * _CHANNEL_LIFETIME_S)
        self._password = password
        self._secured = False
        self._renewal = 0.0
        self._nodes = Nodes(mapping)
        self.subscription = Subscription(self._client, server, self._nodes, self._timeout)

    async def open(self) -> None:
        """Reach the server, resume the session or begin one, and subscribe.

        Raises:
            LinkError: The server cannot be reached.
            RefusedError: It refuses user, certificate, session or mapping.
        """
        client = self._client
        with in_one_sentence(f"the connection to {self._server.endpoint}", self._timeout):
            if not self._secured:
                await secure(client, self._server)
                await identify(client, self._server)
                self._secured = True
            await client.connect_socket()
            await client.send_hello()
            await client.open_secure_channel()
            self._set_renewal()
            if await self._resume():
                self.resumed += 1
            else:
                self.subscription.forget()
                await client.create_session()
                await self._activate()
        if not self.subscription.begun:
            with in_one_sentence("the subscription", self._timeout):
                await self._nodes.find(client)
                await self.subscription.begin()

    def abandon(self) -> None:
        """Let the connection go without a word, and keep what a resumption needs."""
        protocol = self._client.uaclient.protocol
        if protocol is not None and protocol.transport is not None:
            # A link that hangs would not take what is left to send.
            protocol.transport.abort()
        self._client.disconnect_socket()

    async def close(self) -> None:
        """End session and connection; a server that does not answer ends them in its time."""
        session = self._client.uaclient.session
        try:
            await session.close_session(True)
        except (OSError, ua.UaError):
            return
        finally:
            self.abandon()

    async def renew(self) -> None:
        """Renew the channel once its time has come.

        Raises:
            LinkError: The connection is lost, or there was no answer in time.
            RefusedError: The server does not renew it.
        """
        if asyncio.get_running_loop().time() > self._renewal:
            with in_one_sentence("the renewal of the channel", self._timeout):
                await self._client.open_secure_channel(renew=True)
                self._client.uaclient.revolve_security_token()
            self.renewed += 1
            self._set_renewal()

    async def call(self, name: str, command: Command) -> tuple[bool, str]:
        """Return (whether the PLC executed it, one sentence).

        Raises:
            LinkError: The connection is lost, or there was no answer in time.
        """
        try:
            with in_one_sentence(name, self._server.call_timeout_s):
                if command.node:
                    await self._write(f"command {name}", command.value)
                    return True, f"{name}: {command.value} is written"
                request = ua.CallRequest()
                request.Parameters.MethodsToCall = [
                    ua.CallMethodRequest(
                        ObjectId=self._nodes[f"object of {name}"],
                        MethodId=self._nodes[f"method of {name}"],
                    )
                ]
                limit = self._server.call_timeout_s
                answer = await ask(self._client, request, ua.CallResponse, limit)
                (result,) = answer.Results
                result.StatusCode.check()
        except RefusedError as error:
            return False, str(error)
        outputs = [item.Value for item in result.OutputArguments or []]
        message = next((item for item in outputs if isinstance(item, str)), "")
        done = next((item for item in outputs if isinstance(item, bool)), True)
        return done, message or f"{name}: {'done' if done else 'the PLC refuses'}"

    async def beat(self, count: int) -> None:
        """Write the driver's counter.

        Raises:
            LinkError: The connection is lost, or there was no answer in time.
            RefusedError: The server does not take it.
        """
        with in_one_sentence("the driver's heartbeat", self._server.call_timeout_s):
            await self._write(WRITE, count)

    def _set_renewal(self) -> None:
        lifetime = 1e-3 * self._client.secure_channel_timeout
        self._renewal = asyncio.get_running_loop().time() + _RENEWAL * lifetime

    async def _resume(self) -> bool:
        """Return whether the server has kept the session of before."""
        session = self._client.uaclient.session
        if not session.has_session:
            return False
        session.rebind_authentication_token()
        try:
            await self._activate()
        except ua.UaError:
            session.reset_authentication_token()
            return False
        return True

    async def _activate(self) -> None:
        client = self._client
        user, password = self._server.user or None, self._password or None
        await client.activate_session(user, password, client.user_certificate)

    async def _write(self, title: str, value: bool | int) -> None:
        # Some PLCs refuse a write that brings a status or a timestamp of its own.
        data = ua.DataValue(self._nodes.variant(title, value), StatusCode=None)
        request = ua.WriteRequest()
        request.Parameters.NodesToWrite = [
            ua.WriteValue(NodeId=self._nodes[title], AttributeId=ua.AttributeIds.Value, Value=data)
        ]
        limit = self._server.call_timeout_s
        (status,) = (await ask(self._client, request, ua.WriteResponse, limit)).Results
        status.check()
