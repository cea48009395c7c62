"""Why a graph cannot run."""

from __future__ import annotations


class GraphError(RuntimeError):
    """The graph could not be brought up or kept up; the message names the culprit."""
