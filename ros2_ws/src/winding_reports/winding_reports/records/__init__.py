"""What did a run do: its identity, its time series and markers, its lay, its cable over time."""
