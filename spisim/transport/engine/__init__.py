"""The path-tracing engine: ends, walks, sampling strategies, their weights, and the tallies."""
