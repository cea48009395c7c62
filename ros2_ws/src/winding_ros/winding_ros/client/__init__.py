"""How a program conducts the nodes of a graph: services, lifecycle, diagnostics."""
