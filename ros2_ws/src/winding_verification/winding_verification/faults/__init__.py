"""The faults that the graph has to survive, each put into real processes and measured."""
