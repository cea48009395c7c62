"""What a recording says about a topic: its type, the type's definition and hash, its QoS."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import yaml

# A run without a bag needs none of rosbags, so each function imports what it takes from there.
if TYPE_CHECKING:
    from rosbags.interfaces import Qos

_FOREVER = {"sec": 9223372036, "nsec": 854775807}


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One recorded topic.

    Attributes:
        name: Full topic name.
        type_name: Such as sensor_msgs/msg/JointState.
        definition: Text of the type and all its parts, as MCAP's `ros2msg` encoding wants it.
        type_hash: RIHS01 hash (REP-2011).
        qos: Offered profile.
    """

    name: str
    type_name: str
    definition: str
    type_hash: str
    qos: tuple[Qos, ...]

    @property
    def profiles(self) -> list[Any]:
        """Offered profiles as metadata.yaml of version 9 writes them."""
        from rosbags.rosbag2.metadata import dump_qos_v9  # noqa: PLC0415

        return list(dump_qos_v9(list(self.qos)))

    @property
    def profiles_text(self) -> str:
        """Offered profiles as one YAML text, as storage files carry them."""
        return yaml.safe_dump(self.profiles, sort_keys=False)


def jazzy_channel(name: str, type_name: str, *, depth: int, latched: bool) -> Channel:
    """Return the channel of a topic of Jazzy's common types, offered reliably.

    Args:
        name: Full topic name.
        type_name: Such as sensor_msgs/msg/JointState.
        depth: History that the publisher keeps.
        latched: Whether it is transient local.

    Raises:
        KeyError: Jazzy has no such type.
    """
    from rosbags.interfaces import (  # noqa: PLC0415
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    definition, type_hash = _described(type_name)
    forever = QosTime(**_FOREVER)
    durability = QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE
    return Channel(
        name=name,
        type_name=type_name,
        definition=definition,
        type_hash=type_hash,
        qos=(
            Qos(
                history=QosHistory.KEEP_LAST,
                depth=depth,
                reliability=QosReliability.RELIABLE,
                durability=durability,
                deadline=forever,
                lifespan=forever,
                liveliness=QosLiveliness.AUTOMATIC,
                liveliness_lease_duration=forever,
                avoid_ros_namespace_conventions=False,
            ),
        ),
    )


@cache
def _described(type_name: str) -> tuple[str, str]:
    from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415

    types = get_typestore(Stores.ROS2_JAZZY)
    definition, _ = types.generate_msgdef(type_name, ros_version=2)
    return definition, types.hash_rihs01(type_name)
