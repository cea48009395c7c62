"""The command `winding`: each subcommand parses, calls and prints."""
