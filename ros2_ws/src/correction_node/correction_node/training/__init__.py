"""How models are trained and judged; the only place that imports torch."""
