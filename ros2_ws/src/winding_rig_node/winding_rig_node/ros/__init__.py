"""The rig's messages."""
