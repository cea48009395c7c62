"""The folder of these tests is one of modules, for their mutations."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
