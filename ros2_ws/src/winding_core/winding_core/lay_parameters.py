"""Whether the tracker measures the whole lay, stated once for the node and the commands."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.parameters import parameter
from winding_core.units import PLAIN


@dataclass(frozen=True, kw_only=True)
class LayParameters:
    """What is measured beside the markers."""

    measure_lay: bool = parameter(True, "whether every turn on the cylinder is measured", PLAIN)
