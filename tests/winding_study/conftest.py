"""Helpers for pages are those of the reports."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "winding_reports"))
