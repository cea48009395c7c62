"""What the tests of a whole graph share."""

import sys
from pathlib import Path

# Test modules are imported by path, without packages: their neighbours are found from here.
sys.path.insert(0, str(Path(__file__).parent))
