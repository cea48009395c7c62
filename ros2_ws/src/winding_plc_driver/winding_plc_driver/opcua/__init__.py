"""How is the PLC reached? The only place that speaks OPC UA."""
