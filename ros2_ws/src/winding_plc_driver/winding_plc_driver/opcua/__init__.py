"""The only place that speaks OPC UA."""
