"""What the driver knows without a network: mapping, joining, order, link, heartbeats."""
