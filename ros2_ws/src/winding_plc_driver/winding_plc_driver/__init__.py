"""Driver for a winding machine that a PLC runs: OPC UA there, the rig's topics here."""
