"""What every explicit model shares: state, contact and motion of nodes, compilation."""
