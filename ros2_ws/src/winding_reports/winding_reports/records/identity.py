"""Which run or study this was: when, where, with which versions, on what, from which inputs."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Self

from winding_core.cable.condition import Condition
from winding_core.parameters import Value, options, shown_values

# What decides numbers or bytes, by the name that it is imported by.
LIBRARIES = ("python", "numpy", "numba", "rclpy")


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """One value of a condition."""

    value: Value  # In its unit
    unit: str = ""  # Symbol; empty for a pure number or a word
    meaning: str = ""  # What it is
    label: str = ""  # What a form calls it

    @property
    def text(self) -> str:
        """Value and unit as people read them."""
        if isinstance(self.value, bool):
            return "yes" if self.value else "no"
        shown = f"{self.value:g}" if isinstance(self.value, float) else str(self.value)
        return f"{shown} {self.unit}".strip()


@dataclass(frozen=True, kw_only=True)
class Origin:
    """The process that made something."""

    run_id: str  # Different for every run
    began: datetime  # When it was started, with a time zone
    project_version: str  # Of this project
    versions: Mapping[str, str]  # Of LIBRARIES, by name; empty text for one that is not installed
    host: str  # Name of the machine
    # Cable, machine, batch, operator and remark of a run, as far as they are known.
    labels: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.began.utcoffset() is None:
            raise ValueError(f"began needs a time zone, got {self.began.isoformat()}")

    @property
    def date(self) -> str:
        """When it was started: UTC, ISO 8601, to the second."""
        return self.began.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON values."""
        return {
            "run_id": self.run_id,
            "date": self.date,
            "project_version": self.project_version,
            "versions": dict(self.versions),
            "host": self.host,
            **({"labels": dict(self.labels)} if self.labels else {}),
        }

    @property
    def text(self) -> str:
        """The origin as a recording keeps it; `from_text` reads it back."""
        return json.dumps(self.as_json())

    @classmethod
    def from_text(cls, text: str) -> Self:
        """Return the origin that a recording states as JSON text.

        Raises:
            ValueError: It is not one.
        """
        try:
            recorded = json.loads(text)
            return cls(
                run_id=str(recorded["run_id"]),
                began=datetime.fromisoformat(recorded["date"]),
                project_version=str(recorded["project_version"]),
                versions={str(k): str(v) for k, v in recorded["versions"].items()},
                host=str(recorded["host"]),
                labels={str(k): str(v) for k, v in recorded.get("labels", {}).items()},
            )
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"not the origin of a run: {error!r}") from error


@dataclass(frozen=True, kw_only=True)
class Identity:
    """What identifies a run or a study, and what it takes to repeat it."""

    # The process that made it; None where a recording does not state it.
    origin: Origin | None = None
    # Of what was drawn: the simulated sensors of a run, the networks of a study.
    seeds: tuple[int, ...] = ()
    bags: tuple[str, ...] = ()  # Paths of the recordings
    weights: str = ""  # Name or folder of the learned correction; empty without one
    weights_sha256: str = ""  # Digest of its numbers; empty where it is not known
    # What was wound and how, the solver's options included, by the name of the option.
    condition: Mapping[str, Quantity] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON values; null where something is not known."""
        unknown = dict.fromkeys(("run_id", "date", "project_version", "versions", "host"))
        return {
            **(unknown if self.origin is None else self.origin.as_json()),
            "seeds": list(self.seeds),
            "bags": list(self.bags),
            "weights": self.weights or None,
            "weights_sha256": self.weights_sha256 or None,
            "condition": {
                name: {"value": item.value, "unit": item.unit, "meaning": item.meaning}
                for name, item in self.condition.items()
            },
        }

    def texts(self) -> dict[str, str]:
        """Return what a report shows beside the condition, by name."""
        origin = self.origin
        shown = {}
        if origin is not None:
            shown = {
                "Run": origin.run_id,
                "Date (UTC)": origin.date,
                "Host": origin.host,
                "Project": origin.project_version,
                "Versions": ", ".join(
                    f"{name} {version or 'not installed'}"
                    for name, version in origin.versions.items()
                ),
            } | {name.capitalize(): text for name, text in origin.labels.items()}
        if self.seeds:
            shown["Seed" if len(self.seeds) == 1 else "Seeds"] = ", ".join(map(str, self.seeds))
        if self.bags:
            shown["Recording"] = ", ".join(self.bags)
        if self.weights:
            digest = f", sha256 {self.weights_sha256}" if self.weights_sha256 else ""
            shown["Correction"] = f"{self.weights}{digest}"
        return shown


def condition_texts(condition: Mapping[str, Quantity]) -> dict[str, str]:
    """Return what a report shows of a condition, by label."""
    return {item.label or name: item.text or "none" for name, item in condition.items()}


def condition_quantities(condition: Condition) -> dict[str, Quantity]:
    """Return a condition with nothing left open, every value in the unit of its option.

    Raises:
        ParameterError: The condition is incomplete or leaves the range of the model.
    """
    values = condition.as_typed({}) | {"case": condition.resolved().case.number}
    return _quantities(type(condition), values)


def declared_quantities(kind: type, values: Mapping[str, Value]) -> dict[str, Quantity]:
    """Return values [SI] of fields that a record declares, each in the unit of its option."""
    return _quantities(kind, shown_values(kind, values))


def _quantities(kind: type, values: Mapping[str, Value]) -> dict[str, Quantity]:
    known = options(kind)
    return {
        name: Quantity(
            value=value,
            unit=item.unit.symbol if item.unit is not None else "",
            meaning=item.meaning,
            label=item.label,
        )
        for name, value in values.items()
        if (item := known.get(name)) is not None
    }
