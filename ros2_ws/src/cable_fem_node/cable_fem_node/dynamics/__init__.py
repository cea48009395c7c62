"""What every explicit model shares: points, contact law, boundary conditions, energy ledger."""
