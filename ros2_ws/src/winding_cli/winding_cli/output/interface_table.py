"""The graph's interfaces as Markdown, from the one place that declares each."""

from __future__ import annotations

from winding_core.parameters import Declaration, declarations
from winding_ros.graph import PAGE, controlled, parameters_of
from winding_ros.runtime.heartbeat import LEASE, PERIOD, heartbeat_topic
from winding_ros.services import SERVICES
from winding_ros.topics import TOPICS


def as_markdown() -> str:
    """Return tables of topics, services and parameters."""
    return "\n".join([*_topics(), "", *_services(), "", *_parameters()])


def _topics() -> list[str]:
    lines = [
        "| topic | type | publisher | rate | QoS | recorded | what it says |",
        "|---|---|---|---|---|---|---|",
    ]
    for topic in TOPICS:
        rate = "on change" if topic.rate is None else f"{topic.rate:g} Hz"
        durability = ", latched" if topic.latched else ""
        lines.append(
            f"| `{topic.name}` | `{topic.type_name}` | {topic.publisher} | {rate} "
            f"| reliable, depth {topic.depth}{durability} | {'yes' if topic.recorded else 'no'} "
            f"| {topic.description} |"
        )
    lines.append(
        f"| `{heartbeat_topic('<node>')}` | `std_msgs/msg/Header` "
        f"| every node, orchestrator, supervised page | {1.0 / PERIOD:g} Hz "
        f"| reliable, depth 1, liveliness {LEASE:g} s | no "
        "| signs of life; the stamp is wall time |"
    )
    return lines


def _services() -> list[str]:
    lines = ["| service | type | what it does |", "|---|---|---|"]
    lines += [f"| `{item.name}` | `{item.type_name}` | {item.description} |" for item in SERVICES]
    lines.append(
        "| `<node>/change_state`, `<node>/get_state`, ... | `lifecycle_msgs/srv/*` "
        "| lifecycle of every node |"
    )
    return lines


def _parameters() -> list[str]:
    lines = []
    for spec in (*reversed(controlled()), PAGE):
        lines += [
            f"### Parameters of `{spec.name}`",
            "",
            "| parameter | type | default | range | meaning |",
            "|---|---|---|---|---|",
        ]
        lines += [_parameter_row(item) for item in declarations(parameters_of(spec))]
        lines.append("")
    return lines[:-1]


def _parameter_row(item: Declaration) -> str:
    default = f"`{item.default}`" if item.default != "" else "empty"
    return f"| `{item.name}` | {item.type_name} | {default} | {_range(item)} | {item.description} |"


def _range(item: Declaration) -> str:
    if item.choices is not None:
        return ", ".join(f"`{choice}`" if choice else "empty" for choice in item.choices)
    if item.low is None and item.high is None:
        return ""
    if item.high is None:
        return f"at least {item.low:g}"
    if item.low is None:
        return f"at most {item.high:g}"
    return f"{item.low:g} to {item.high:g}"
