"""Names of the texts that a recording keeps beside its messages (`custom_data` of rosbag2)."""

from __future__ import annotations

# Whether the recording went on to the end of the run: "yes", or "no: " and the reason.
COMPLETE = "complete"
YES = "yes"
# Before a topic's full name: messages that were published and never arrived.
LOST = "lost "
# Before a node's name: its parameters as JSON.
PARAMETERS = "parameters "
# The recording that this one was made from, and what was lost with it.
RECOVERED = "recovered from"
# Which run this is, as JSON: id, date, version of the project, versions of libraries, host.
ORIGIN = "origin"
