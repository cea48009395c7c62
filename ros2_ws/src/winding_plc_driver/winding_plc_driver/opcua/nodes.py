"""The mapping's nodes on a server: found, checked, and with the types of what is written."""

from asyncua import Client, ua

from winding_plc_driver.machine.mapping import MachineMapping
from winding_plc_driver.opcua.request import RefusedError

_UNREADABLE = (
    ua.StatusCodes.BadNodeIdUnknown,
    ua.StatusCodes.BadNodeIdInvalid,
    ua.StatusCodes.BadAttributeIdInvalid,
    ua.StatusCodes.BadNotReadable,
    ua.StatusCodes.BadUserAccessDenied,
)
# Titles of nodes that are no numbers of the machine.
STATE, READ, WRITE = "state", "read of heartbeat", "write of heartbeat"


class Nodes:
    """Node ids and types by title."""

    def __init__(self, mapping: MachineMapping) -> None:
        self._numbers = {name: variable.node for name, variable in mapping.variables.items()}
        beside = {
            STATE: mapping.state.node if mapping.state is not None else "",
            READ: mapping.heartbeat.read,
        }
        written = {WRITE: mapping.heartbeat.write}
        self._methods: dict[str, str] = {}
        for name, command in mapping.commands.items():
            written[f"command {name}"] = command.node
            self._methods[f"object of {name}"] = command.object
            self._methods[f"method of {name}"] = command.method
        # Titles of the variables to subscribe to.
        self.watched = [title for title, text in (self._numbers | beside).items() if text]
        self._variables = {
            title: text for title, text in (self._numbers | beside | written).items() if text
        }
        self._methods = {title: text for title, text in self._methods.items() if text}
        self._ids: dict[str, ua.NodeId] = {}
        self._types: dict[str, ua.VariantType] = {}

    def __getitem__(self, title: str) -> ua.NodeId:
        """Return the node id of a title."""
        return self._ids[title]

    def variant(self, title: str, value: bool | int) -> ua.Variant:
        """Return a value in the type that the server has for a variable."""
        return ua.Variant(value, self._types[title])

    async def find(self, client: Client) -> None:
        """Look for every node.

        Raises:
            UaError: The server refuses to be read.
            OSError: The connection is lost.
            RefusedError: A node is not there, or is of another kind.
        """
        uris = await client.get_namespace_array()
        texts = self._variables | self._methods
        self._ids = {title: _node_id(title, text, uris) for title, text in texts.items()}
        requests = [
            ua.ReadValueId(
                NodeId=node,
                AttributeId=ua.AttributeIds.Value
                if title in self._variables
                else ua.AttributeIds.NodeClass,
            )
            for title, node in self._ids.items()
        ]
        answers = await client.uaclient.session.read(ua.ReadParameters(NodesToRead=requests))
        for (title, text), answer in zip(texts.items(), answers, strict=True):
            self._check(title, text, answer)

    def _check(self, title: str, text: str, answer: ua.DataValue) -> None:
        if answer.StatusCode is not None and answer.StatusCode.value in _UNREADABLE:
            raise RefusedError(f"{title} cannot be read at {text}: {answer.StatusCode.name}")
        value = answer.Value.Value if answer.Value is not None else None
        if title.startswith("method of ") and value != ua.NodeClass.Method:
            raise RefusedError(f"{title} at {text} is no method")
        if title in self._numbers and not isinstance(value, int | float | None):
            raise RefusedError(f"{title} at {text} must be a number, got {value!r:.60}")
        if answer.Value is not None:
            self._types[title] = answer.Value.VariantType


def _node_id(title: str, text: str, uris: list[str]) -> ua.NodeId:
    """Return a node id with the index that the server gives its namespace."""
    if not text.startswith("nsu="):
        return ua.NodeId.from_string(text)
    uri, _, rest = text.removeprefix("nsu=").partition(";")
    if uri not in uris:
        raise RefusedError(f"{title} is in namespace {uri}, which the server does not have")
    return ua.NodeId.from_string(f"ns={uris.index(uri)};{rest}")
