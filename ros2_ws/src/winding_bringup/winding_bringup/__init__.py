"""The graph: its nodes as data, the orchestrator that runs them, the recorder, the command."""
