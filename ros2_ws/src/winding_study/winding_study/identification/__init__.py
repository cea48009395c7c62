"""Materials told by several runs of a cable or by a tensile test: offline, no node needs them."""
