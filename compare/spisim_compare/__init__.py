"""Two recordings of what should be the same: whether they differ, where, and what explains it."""
