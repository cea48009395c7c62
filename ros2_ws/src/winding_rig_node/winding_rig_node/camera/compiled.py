"""How this package compiles a kernel."""

from __future__ import annotations

from pathlib import Path

from cable_winding.compiling import compiler

compiled = compiler(Path(__file__).parent)
