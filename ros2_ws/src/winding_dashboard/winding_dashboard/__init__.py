"""The operator's page: what the machine does, what the twin expects, and the buttons."""
