"""The independent renderer beside these tests is found from here."""

import sys
from pathlib import Path

# Test modules are imported by path, without packages.
sys.path.insert(0, str(Path(__file__).parent))
