"""The engine: walks from both ends of the light, strategies, their weights, and the sums."""
