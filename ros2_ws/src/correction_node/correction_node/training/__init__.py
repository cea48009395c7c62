"""How is h learned and judged? The only place that imports torch."""
