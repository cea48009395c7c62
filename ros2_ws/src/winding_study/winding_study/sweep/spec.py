"""What a sweep varies: a YAML text becomes the options of every run, in order."""

from __future__ import annotations

import difflib
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import yaml

from winding_core.yaml_text import PlainLoader, YamlTextError, load_yaml
from winding_study.sweep.axes import LIMIT, SpecError, Value, axis_values

GRID, ZIP = "grid", "zip"


@dataclass(frozen=True, kw_only=True)
class SweepSpec:
    """A sweep's parameters with their values.

    Attributes:
        axes: Values of each parameter that is named, in the text's order.
        combine: `grid`, every value with every other, the last parameter fastest; or `zip`,
            first values together, second values together, single values with all.
    """

    axes: Mapping[str, tuple[Value, ...]]
    combine: str

    def __len__(self) -> int:
        counts = [len(values) for values in self.axes.values()]
        return math.prod(counts) if self.combine == GRID else max(counts)

    def __iter__(self) -> Iterator[dict[str, Value]]:
        rows: Iterable[tuple[Value, ...]]
        if self.combine == GRID:
            rows = itertools.product(*self.axes.values())
        else:
            repeated = (values * (len(self) // len(values)) for values in self.axes.values())
            rows = zip(*repeated, strict=True)
        for row in rows:
            yield dict(zip(self.axes, row, strict=True))

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of the parameters with more than one value."""
        return tuple(name for name, values in self.axes.items() if len(values) > 1)


def parse_spec(text: str, kinds: Mapping[str, type]) -> SweepSpec:
    """Read a sweep's description.

    Args:
        text: YAML with `parameters` (see `axes.axis_values`) and, where wanted, `combine`.
        kinds: Type of every parameter that may be swept.

    Raises:
        SpecError: The text cannot be used.
    """
    try:
        content = load_yaml(text, _StrictLoader)
    except YamlTextError as error:
        raise SpecError(f"it is no YAML: {error}") from error
    if not isinstance(content, dict) or not isinstance(content.get("parameters"), dict):
        raise SpecError("it must hold a mapping named parameters")
    for word in content:
        if word not in ("parameters", "combine"):
            raise SpecError(f"it holds {word!r}; it may hold parameters and combine")
    combine = content.get("combine", GRID)
    if combine not in (GRID, ZIP):
        raise SpecError(f"combine must be {GRID} or {ZIP}, got {combine!r}")
    given = content["parameters"]
    if not given:
        raise SpecError("it names no parameter")
    axes = {name: _axis(name, value, kinds) for name, value in given.items()}
    spec = SweepSpec(axes=axes, combine=combine)
    if combine == ZIP:
        lengths = {name: len(values) for name, values in axes.items() if len(values) > 1}
        if len(set(lengths.values())) > 1:
            counts = ", ".join(f"{name} {count}" for name, count in lengths.items())
            raise SpecError(f"zip needs as many values of each parameter, got {counts}")
    if len(spec) > LIMIT:
        raise SpecError(f"it has {len(spec)} runs, more than {LIMIT}")
    return spec


def _axis(name: object, value: object, kinds: Mapping[str, type]) -> tuple[Value, ...]:
    if name not in kinds or not isinstance(name, str):
        near = difflib.get_close_matches(str(name), list(kinds), n=1, cutoff=0.0)
        raise SpecError(f"there is no parameter {name}; did you mean {near[0]}?")
    return tuple(axis_values(name, kinds[name], value))


class _StrictLoader(PlainLoader):
    """The plain loader, but a name that stands twice is an error."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        names: set[str] = set()
        for key, _ in node.value:
            name = self.construct_object(key, deep=True)
            if not isinstance(name, str):
                raise yaml.YAMLError(f"a name must be a word, got {name!r}{node.start_mark}")
            if name in names:
                raise yaml.YAMLError(f"{name} stands twice{node.start_mark}")
            names.add(name)
        return super().construct_mapping(node, deep)
