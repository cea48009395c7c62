"""How this package compiles a kernel."""

from __future__ import annotations

from pathlib import Path

from winding_core.compiling import compiler

compiled = compiler(Path(__file__).parent)
